"""Campaigns and training sets of the research; `onecycle.campaign` and `onecycle.dataset` share them out."""

from ._lab import Campaign, ClassifierSets, Dataset, dataset_file

__all__ = ["Campaign", "ClassifierSets", "Dataset", "dataset_file"]
