"""What is known of each received message: is it valid, in sequence, fresh?"""
