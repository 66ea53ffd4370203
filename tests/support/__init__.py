"""What several tests share: models, small files, reference computations."""
