#pragma once

#include "loopclosure/vocabulary.hpp"

namespace twofold {

/// The vocabulary that ships with the program (scripts/train_vocabulary says what it was trained on). It
/// stands in the program itself, so that nothing has to be found at run time.
[[nodiscard]] Vocabulary load_default_vocabulary();

}  // namespace twofold
