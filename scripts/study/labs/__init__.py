"""Labs of docs/labs that are answered in words and numbers: tasks and keys, by a student's number."""
