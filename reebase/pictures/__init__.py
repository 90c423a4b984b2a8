"""Pictures of meshes with their skeletons, of answers to queries, and plots of evaluations.

Everything returns the bytes of a file, needs matplotlib (``pip install 'reebase[pictures]'``) and leaves its
global state alone. The same input gives the same bytes under the same version of matplotlib. Colours are
colour-blind safe: after Okabe and Ito (2008) for endpoints and curves, viridis and red-blue for scalars.
"""

from reebase.pictures.plots import matrix_plot, precision_recall_plot
from reebase.pictures.sheets import HitPanel, Panel, answer_picture, contact_sheet, picture
from reebase.pictures.view import View, placed

__all__ = [
    "HitPanel", "Panel", "View", "answer_picture", "contact_sheet", "matrix_plot", "picture", "placed",
    "precision_recall_plot",
]  # fmt: skip
