"""What knows no physics: errors, the runtime, the schema, fields, rotations, files."""
