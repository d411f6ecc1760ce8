"""What limits a program: ceilings of the machine, samples of where its time goes, the roofline."""
