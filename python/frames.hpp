#pragma once

#include <string>
#include <vector>

#include "twofold/source.hpp"

namespace twofold::python {

/// Frame of package twofold.
struct PythonFrame {
  FrameView view;                   ///< with an owner
  std::vector<std::string> copied;  ///< images that could not stay where they were
};

}  // namespace twofold::python
