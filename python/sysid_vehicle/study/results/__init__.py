"""What a study holds and says: effects, figures, sentences, next steps."""
