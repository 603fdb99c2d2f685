"""Shared media: what a frame costs, who may send when, and what becomes of it on the air."""
