"""Instances and triangles of COLLADA, 3DXML and XAML files, counted from their XML."""
