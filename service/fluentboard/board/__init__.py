"""The blackboard without a network: journal, projections, subscriptions."""
