"""The daemon: controller (frames in, frames out), loop, health."""
