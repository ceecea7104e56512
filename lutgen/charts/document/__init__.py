"""The results of the source document (Zhang, Human face rendering), and what they are compared with."""
