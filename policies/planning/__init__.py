"""Plans: contact-free paths of an arm, and motions along them."""
