"""What every other package rests on: phases and scenes, builds, runs, stored files, the command line."""
