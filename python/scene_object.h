#pragma once

#include <memory>
#include <string>
#include <vector>

#include "data/scene.h"
#include "python/bindings.h"

namespace unfurl::python {

/// A scene as Python has it.
struct Scene {
  data::Scene scene;
  std::string text;  // as the person wrote it
  std::vector<Source> sources;
};

/// The object as it is, or read from the path that was given in its place, keys changed by `set`.
std::shared_ptr<Scene> SceneFrom(const py::object& object, const py::object& set);

}  // namespace unfurl::python
