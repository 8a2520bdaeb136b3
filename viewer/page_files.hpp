#pragma once

#include <span>
#include <string_view>

namespace twofold {

/// A file of the page as it was bundled when the program was built (viewer/page/bundle.mjs), compressed by
/// gzip.
struct PageFile {
  std::string_view path;  ///< "/", "/page.js", ...
  std::string_view type;  ///< media type
  std::string_view gzip;
};
[[nodiscard]] std::span<const PageFile> page_files();

}  // namespace twofold
