"""Everything that touches OCCT: the only part of cqblend that imports OCP.

Conversion between OCCT's geometry and `cqblend.splines`, rewriting of solids, measurement of finished shapes, and STEP.
The rooms below do not depend on OCCT, and those above need not import it.
"""

try:
    import OCP.Standard  # noqa: F401  (fails here, in one place, if the binding is missing or cannot be loaded)
except ImportError as error:
    from cqblend.installation_check import explain_import_failure

    raise explain_import_failure(error) from error
