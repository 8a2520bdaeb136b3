#pragma once

#include <exception>
#include <string>

namespace twofold {

/// Of the exception that is being handled: to be called in a `catch (...)`.
[[nodiscard]] inline std::string what_was_thrown() {
  try {
    throw;
  } catch (const std::exception& error) {
    return error.what();
  } catch (...) {
    return "an exception of unknown type";
  }
}

}  // namespace twofold
