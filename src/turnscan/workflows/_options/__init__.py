"""What each verb takes: options in the words of the doors, their declaration and schemas."""
