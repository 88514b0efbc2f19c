"""Force laws, one per file; `find_effects` discovers them here and in `$LSM_PLUGINS/effects`."""

import importlib
import importlib.util
import inspect
import os
import pkgutil
from pathlib import Path

from .base import Bodies, Effect, HistoryValue, contact_type, effect_name, require


def find_effects():
    """All laws as {name: class}, in alphabetical order. Raises ImportError naming a plugin that cannot be read."""
    modules = [
        importlib.import_module(f"{__name__}.{m.name}") for m in pkgutil.iter_modules(__path__) if m.name != "base"
    ]
    folder = os.environ.get("LSM_PLUGINS")
    for path in sorted(Path(folder, "effects").glob("*.py")) if folder else []:
        spec = importlib.util.spec_from_file_location(f"lsm_plugin_{path.stem}", path)
        module = importlib.util.module_from_spec(spec)
        try:
            spec.loader.exec_module(module)
        except Exception as error:
            raise ImportError(f"plugin {path}: {error}") from error
        modules.append(module)
    found = {}
    for module in modules:
        for _, cls in inspect.getmembers(module, inspect.isclass):
            if issubclass(cls, Effect) and cls is not Effect and cls.__module__ == module.__name__:
                found[effect_name(cls)] = cls
    return dict(sorted(found.items()))


__all__ = ["Bodies", "Effect", "HistoryValue", "contact_type", "effect_name", "find_effects", "require"]
