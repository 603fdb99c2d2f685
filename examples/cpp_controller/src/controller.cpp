// A controller that knows nothing of etac_ros: it answers each signal with a torque.
//
//   colcon build --base-paths examples/cpp_controller      (on a full ROS 2 Jazzy: the wheels have no headers)
//   ros2 run etac_cpp_controller controller --ros-args
//     -r signal:=/filtered_error -r command:=/torque_command -p gain:=-26.113821209155528

#include <memory>

#include "geometry_msgs/msg/point32.hpp"
#include "rclcpp/rclcpp.hpp"

using geometry_msgs::msg::Point32;

class Controller : public rclcpp::Node
{
public:
  Controller() : Node("cpp_controller"), gain_(declare_parameter("gain", 1.0))
  {
    const auto profile = rclcpp::QoS(10).reliable().durability_volatile();
    publisher_ = create_publisher<Point32>("command", profile);
    subscription_ = create_subscription<Point32>(
      "signal", profile, [this](const Point32 & signal) {
        Point32 command;
        command.x = static_cast<float>(gain_ * signal.x);
        command.y = static_cast<float>(gain_ * signal.y);
        command.z = static_cast<float>(gain_ * signal.z);
        publisher_->publish(command);
      });
  }

private:
  const double gain_;
  rclcpp::Publisher<Point32>::SharedPtr publisher_;
  rclcpp::Subscription<Point32>::SharedPtr subscription_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<Controller>());
  rclcpp::shutdown();
}
