"""From a deployment file to a checked plan: what runs where, connected how. Nothing here starts anything."""

from sonar_component.middleware.deployment.check import check_deployment
from sonar_component.middleware.deployment.plan import ConnectionPlan, Plan, TaskPlan

__all__ = ["ConnectionPlan", "Plan", "TaskPlan", "check_deployment"]
