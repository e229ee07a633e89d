"""What a leg can carry: efforts, indices, load capacity, friction and step length."""
