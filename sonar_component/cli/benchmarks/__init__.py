"""What `sonar bench` measures; each benchmark returns plain data that is printed, plotted and written as JSON."""
