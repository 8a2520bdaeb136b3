#include "io/sources/source_path.hpp"

#include "io/sources/source_parameters.hpp"

namespace twofold {

std::optional<std::filesystem::path> path_of_source(const std::string& text) {
  const SourceSpec spec = parse_source_spec(text);
  std::error_code ignored;
  if (spec.scheme == "synthetic" || spec.scheme == "v4l2") return std::nullopt;
  if (std::filesystem::is_character_file(spec.argument, ignored)) return std::nullopt;
  return spec.argument;
}

std::string absolute_source(const std::string& text) {
  const auto path = path_of_source(text);
  if (!path) return text;
  const SourceSpec spec = parse_source_spec(text);
  const std::size_t begin = spec.scheme.empty() ? 0 : spec.scheme.size() + 1;
  std::string absolute = text;
  absolute.replace(begin, spec.argument.size(), std::filesystem::absolute(*path).string());
  return absolute;
}

}  // namespace twofold
