#include <cerrno>
#include <cstring>
#include <fstream>

#include "graph/map_builder.hpp"
#include "graph/map_file.hpp"
#include "graph/map_format.hpp"
#include "graph/map_section_reader.hpp"

namespace twofold {
namespace {

using namespace map_format;

/// @return false at the end section
bool take_section(const RawSection& raw, bool first, MapBuilder& builder) {
  const auto section = static_cast<Section>(raw.id);
  if (first != (section == Section::kHead)) throw MalformedBytes("is not where it belongs");
  switch (section) {
    case Section::kHead:
      builder.take_head(EntryReader(raw.bytes));
      return true;
    case Section::kKeyframes:
      builder.take_keyframes(EntryReader(raw.bytes));
      return true;
    case Section::kPoints:
      builder.take_points(EntryReader(raw.bytes));
      return true;
    case Section::kPlaces:
      builder.take_places(EntryReader(raw.bytes));
      return true;
    case Section::kEnd:
      EntryReader(raw.bytes).expect_end();
      return false;
  }
  if ((raw.id & kSkippable) == 0) throw MalformedBytes("is of a kind this program does not know");
  return true;
}

}  // namespace

SavedMap read_map(std::istream& in, std::uint64_t size, const std::string& name) {
  SectionReader reader(in, size);
  MapBuilder builder;
  RawSection section;
  int number = 0;
  try {
    builder.read_version(reader.read_header());
    do {
      number += 1;
      section.id = ~0U;
      reader.next(section);
    } while (take_section(section, number == 1, builder));
    number = 0;
    if (reader.left() > 0) throw MalformedBytes("bytes follow after the end section");
    return builder.finish();
  } catch (const MalformedBytes& error) {
    if (number == 0) throw MapFileError(name + ": " + error.what());
    const std::string which =
        section.id == ~0U ? "" : std::string(" (") + name_of(static_cast<Section>(section.id)) + ")";
    throw MapFileError(name + ": section " + std::to_string(number) + which + ": " + error.what());
  }
}

SavedMap load_map(const std::filesystem::path& file) {
  std::error_code error;
  const auto size = std::filesystem::file_size(file, error);
  std::ifstream in(file, std::ios::binary);
  if (error) throw MapFileError(file.string() + ": cannot be opened: " + error.message());
  if (!in) throw MapFileError(file.string() + ": cannot be opened: " + std::strerror(errno));
  return read_map(in, size, file.string());
}

}  // namespace twofold
