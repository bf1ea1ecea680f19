"""The names of graspsense.classifier_api, for type checkers and for `core/components/lazy_names.py`."""

# Reasons for an answer
from graspsense.core.values.reasons import Reason as Reason
from graspsense.core.values.reasons import FeatureValue as FeatureValue
from graspsense.core.values.reasons import Contribution as Contribution
from graspsense.core.values.reasons import contribution_reasons as contribution_reasons
from graspsense.core.values.reasons import feature_values as feature_values
from graspsense.core.values.reasons import missing_feature as missing_feature
from graspsense.core.values.units import in_words as in_words

# Trees
from graspsense.core.values.reasons import TreeNode as TreeNode
from graspsense.core.learn.decision_path import SplitTest as SplitTest
from graspsense.core.learn.decision_path import leaf_reason as leaf_reason
from graspsense.core.learn.decision_path import path_reasons as path_reasons

# Tables and nominal features
from graspsense.core.values.features import table_of as table_of
from graspsense.core.values.nominal import CodedColumn as CodedColumn
from graspsense.core.values.nominal import codes_of as codes_of
from graspsense.core.values.nominal import with_codes as with_codes

from graspsense.core.values.json_values import json_ready as json_ready

# Features on one scale
from graspsense.core.learn.scaling import Scaling as Scaling
from graspsense.core.learn.scaling import mean_and_deviation as mean_and_deviation
from graspsense.core.learn.scaling import scaling_of as scaling_of

# Linear algebra
from graspsense.core.learn.one_thread import one_thread as one_thread

# Stored models
from graspsense.core.learn.stored_values import LARGEST_SEED as LARGEST_SEED
