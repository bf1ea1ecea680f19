"""What the tests need of LeRobot where it is not installed: its abstract classes, as small as they can be.

Where LeRobot is installed (`.ci/lerobot_itself`), nothing here is used: the same tests run with the true classes.
"""

from __future__ import annotations

import abc
import importlib.util
import sys
from dataclasses import dataclass
from types import ModuleType, SimpleNamespace
from typing import ClassVar


@dataclass(kw_only=True)
class RobotConfig:
    id: str | None = None
    known: ClassVar[dict] = {}

    @classmethod
    def register_subclass(cls, name):
        def register(subclass):
            cls.known[name] = subclass
            subclass.type = name
            return subclass

        return register

    @classmethod
    def get_known_choices(cls):
        return cls.known


class Robot(abc.ABC):
    def __init__(self, config):
        self.id = config.id

    @abc.abstractmethod
    def connect(self, calibrate=True): ...

    @abc.abstractmethod
    def get_observation(self): ...

    @abc.abstractmethod
    def send_action(self, action): ...

    @abc.abstractmethod
    def disconnect(self): ...


class ProcessorStep(abc.ABC):
    @abc.abstractmethod
    def __call__(self, transition): ...

    @abc.abstractmethod
    def transform_features(self, features): ...


class ObservationProcessorStep(ProcessorStep):
    @abc.abstractmethod
    def observation(self, observation): ...

    def __call__(self, transition):
        return {**transition, "observation": self.observation(dict(transition["observation"]))}


class Registry:
    @classmethod
    def register(cls, name):
        return lambda step: step


def made(config):
    module = sys.modules[type(config).__module__]
    return getattr(module, type(config).__name__.removesuffix("Config"))(config)


def decode(base, values):
    given = dict(values)
    return base.known[given.pop("type")](**given)


def module(name, **names):
    made_module = ModuleType(name)
    made_module.__path__ = []
    vars(made_module).update(names)
    sys.modules[name] = made_module


INSTALLED = importlib.util.find_spec("lerobot") is not None
if not INSTALLED:
    module("lerobot")
    module("lerobot.robots", Robot=Robot, RobotConfig=RobotConfig, make_robot_from_config=made)
    module("lerobot.utils")
    module("lerobot.utils.import_utils", register_third_party_plugins=lambda: None)
    steps = {"ObservationProcessorStep": ObservationProcessorStep, "ProcessorStepRegistry": Registry}
    module("lerobot.processor", **steps)
    module("lerobot.configs")
    types = {"FeatureType": SimpleNamespace(STATE="STATE"), "PolicyFeature": SimpleNamespace}
    types["PipelineFeatureType"] = SimpleNamespace(OBSERVATION="OBSERVATION")
    module("lerobot.configs.types", **types)
    module("draccus", decode=decode)
