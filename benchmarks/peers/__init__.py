"""The same questions put to other software, on the same inputs."""
