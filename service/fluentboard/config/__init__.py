"""Settings: every default, its unit, its environment variable.

The defaults are complete, so nothing needs to be configured to start. A YAML file overrides them,
`FLUENTBOARD_<SECTION>_<KEY>` variables override the file, and flags override the variables.
"""

from fluentboard.config.loading import ENVIRONMENT_PREFIX, environment_variable, load_settings
from fluentboard.config.printing import settings_yaml
from fluentboard.config.sections import (
    LimitSettings,
    LogSettings,
    Role,
    SecuritySettings,
    ServerSettings,
    Settings,
    StorageSettings,
    SubscriptionSettings,
    Token,
    is_loopback,
    setting_sections,
)

__all__ = [
    "ENVIRONMENT_PREFIX",
    "LimitSettings",
    "LogSettings",
    "Role",
    "SecuritySettings",
    "ServerSettings",
    "Settings",
    "StorageSettings",
    "SubscriptionSettings",
    "Token",
    "environment_variable",
    "is_loopback",
    "load_settings",
    "setting_sections",
    "settings_yaml",
]
