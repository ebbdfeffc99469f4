"""The scan file (SQLite): plan, rig, frames; the only code that writes one."""
