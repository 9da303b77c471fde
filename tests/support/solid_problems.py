"""What is wrong with a solid, as a list of lines."""

from cqblend.brep.verification.solid_verification import check_solid


def list_problems(*arguments, **options):
    """Return the problems that check_solid tells."""
    return list(check_solid(*arguments, **options).problems)
