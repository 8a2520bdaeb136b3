#pragma once

#include <string>

namespace twofold {

/// nlohmann's `json` as text; `indent` as of its dump. Names of files may hold bytes that are no UTF-8: the
/// text has U+FFFD there, where dump would throw.
template <class Json>
[[nodiscard]] std::string text_of_json(const Json& json, int indent = -1) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

}  // namespace twofold
