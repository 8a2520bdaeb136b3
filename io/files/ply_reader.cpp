// read_ply_mesh: PLY files of any writer.
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "io/files/io_error.hpp"
#include "io/files/mesh_file.hpp"
#include "io/files/text_file.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

enum class PlyType : std::uint8_t { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kFloat;
  std::optional<PlyType> count;  ///< of a list's length
};
struct PlyElement {
  std::string name;
  std::size_t count = 0;
  std::vector<PlyProperty> properties;
};

std::optional<PlyType> type_named(std::string_view name) {
  struct Name {
    std::string_view first, second;
  };
  constexpr Name kNames[] = {{"char", "int8"},     {"uchar", "uint8"},   {"short", "int16"},
                             {"ushort", "uint16"}, {"int", "int32"},     {"uint", "uint32"},
                             {"float", "float32"}, {"double", "float64"}};
  for (std::size_t t = 0; t < std::size(kNames); ++t)
    if (name == kNames[t].first || name == kNames[t].second) return static_cast<PlyType>(t);
  return std::nullopt;
}

constexpr std::size_t kSizes[] = {1, 1, 2, 2, 4, 4, 4, 8};

class PlyReader {
 public:
  explicit PlyReader(fs::path file) : file_(std::move(file)) {
    if (fs::is_directory(file_)) fail("is a folder, no PLY file");
    std::ifstream in(file_, std::ios::binary);
    if (!in) throw IoError(file_.string(), "cannot be opened");
    bytes_.assign(std::istreambuf_iterator<char>(in), {});
  }

  TriangleMesh read() {
    read_header();
    TriangleMesh mesh;
    for (const PlyElement& element : elements_) {
      expect_room(element);
      for (std::size_t n = 0; n < element.count; ++n) {
        if (element.name == "vertex") {
          read_vertex(element, mesh);
        } else {
          read_other(element, mesh);
        }
      }
    }
    for (const auto& t : mesh.triangles)
      for (const std::uint32_t v : t)
        if (v >= mesh.positions.size())
          fail(fmt::format("a face names vertex {}, there are {}", v, mesh.positions.size()));
    return mesh;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const { throw IoError(file_.string(), what); }

  std::string_view header_line() {
    const std::size_t end = bytes_.find('\n', at_);
    if (end == std::string::npos || end - at_ > 4096) fail("is no PLY file: its header does not end");
    std::string_view line(bytes_.data() + at_, end - at_);
    at_ = end + 1;
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    return line;
  }

  void read_header() {
    if (header_line() != "ply") fail("is no PLY file");
    for (;;) {
      const std::string_view line = header_line();
      const auto fields = split_fields(line);
      if (fields.empty() || fields[0] == "comment" || fields[0] == "obj_info") continue;
      if (fields[0] == "end_header") break;
      if (fields[0] == "format" && fields.size() == 3) {
        ascii_ = fields[1] == "ascii";
        if (!ascii_ && fields[1] != "binary_little_endian")
          fail(fmt::format("is of PLY format {}, which is not read here", fields[1]));
      } else if (fields[0] == "element" && fields.size() == 3) {
        const auto count = to_integer(fields[2]);
        if (!count || *count < 0) fail(fmt::format("has no count in '{}'", line));
        elements_.push_back({std::string(fields[1]), static_cast<std::size_t>(*count), {}});
      } else if (fields[0] == "property" && !elements_.empty()) {
        add_property(fields, line);
      } else {
        fail(fmt::format("has a header line that is not understood: '{}'", line));
      }
    }
  }

  void add_property(const std::vector<std::string_view>& fields, std::string_view line) {
    PlyProperty property;
    property.name = fields.back();
    std::optional<PlyType> type;
    if (fields.size() == 5 && fields[1] == "list") {
      property.count = type_named(fields[2]);
      type = type_named(fields[3]);
      if (!property.count) type.reset();
    } else if (fields.size() == 3) {
      type = type_named(fields[1]);
    }
    if (!type) fail(fmt::format("has a property that is not understood: '{}'", line));
    property.type = *type;
    elements_.back().properties.push_back(std::move(property));
  }

  /// Before anything is reserved: the counts of a header are not believed beyond the file's size.
  void expect_room(const PlyElement& element) const {
    std::size_t least = 0;
    for (const PlyProperty& p : element.properties)
      least += ascii_ ? 2 : kSizes[static_cast<std::size_t>(p.count.value_or(p.type))];
    if (least == 0 && element.count > 0)
      fail(fmt::format("has elements '{}' without properties", element.name));
    if (least > 0 && element.count > (bytes_.size() - at_ + 1) / least)
      fail(fmt::format("is too short for {} elements '{}'", element.count, element.name));
  }

  double number(PlyType type) {
    if (ascii_) return ascii_number();
    const std::size_t size = kSizes[static_cast<std::size_t>(type)];
    if (bytes_.size() - at_ < size) fail("ends in the middle of an element");
    const char* from = bytes_.data() + at_;
    at_ += size;
    const auto as = [from](auto value) {
      std::memcpy(&value, from, sizeof(value));
      return static_cast<double>(value);
    };
    switch (type) {
      case PlyType::kInt8:
        return as(std::int8_t{});
      case PlyType::kUint8:
        return as(std::uint8_t{});
      case PlyType::kInt16:
        return as(std::int16_t{});
      case PlyType::kUint16:
        return as(std::uint16_t{});
      case PlyType::kInt32:
        return as(std::int32_t{});
      case PlyType::kUint32:
        return as(std::uint32_t{});
      case PlyType::kFloat:
        return as(float{});
      case PlyType::kDouble:
        break;
    }
    return as(double{});
  }

  double ascii_number() {
    constexpr std::string_view kSpace = " \t\r\n";
    const std::size_t begin = bytes_.find_first_not_of(kSpace, at_);
    if (begin == std::string::npos) fail("ends in the middle of an element");
    at_ = std::min(bytes_.find_first_of(kSpace, begin), bytes_.size());
    const auto value = to_number(std::string_view(bytes_).substr(begin, at_ - begin));
    if (!value)
      fail(fmt::format("has '{}' where a number should be",
                       bytes_.substr(begin, std::min<std::size_t>(at_ - begin, 40))));
    return *value;
  }

  /// Entries of a list that is left out are read and forgotten.
  std::vector<std::uint32_t> list(const PlyProperty& property) {
    const double count = number(*property.count);
    const std::size_t least = ascii_ ? 2 : kSizes[static_cast<std::size_t>(property.type)];
    if (!(count >= 0) || count > static_cast<double>((bytes_.size() - at_ + 1) / least))
      fail("has a list that is longer than the file");
    std::vector<std::uint32_t> entries;
    for (double n = 0; n < count; ++n) {
      const double entry = number(property.type);
      entries.push_back(entry >= 0 && entry < 4294967295.0 ? static_cast<std::uint32_t>(entry) : 0xffffffffU);
    }
    return entries;
  }

  void read_vertex(const PlyElement& element, TriangleMesh& mesh) {
    Eigen::Vector3f x(NAN, NAN, NAN), n(NAN, NAN, NAN);
    std::array<int, 3> rgb{-1, -1, -1};
    for (const PlyProperty& property : element.properties) {
      if (property.count) {
        (void)list(property);
        continue;
      }
      const double value = number(property.type);
      constexpr std::string_view kPosition[] = {"x", "y", "z"}, kNormal[] = {"nx", "ny", "nz"},
                                 kColour[] = {"red", "green", "blue"};
      for (int i = 0; i < 3; ++i) {
        if (property.name == kPosition[i]) x[i] = static_cast<float>(value);
        if (property.name == kNormal[i]) n[i] = static_cast<float>(value);
        if (property.name == kColour[i] && property.type == PlyType::kUint8)
          rgb[static_cast<std::size_t>(i)] = static_cast<int>(std::clamp(value, 0.0, 255.0));
      }
    }
    if (!x.allFinite()) fail(fmt::format("vertex {} has no finite position x y z", mesh.positions.size()));
    const bool first = mesh.positions.empty();
    if (n.allFinite() && (first || !mesh.normals.empty())) mesh.normals.push_back(n);
    if (rgb[0] >= 0 && rgb[1] >= 0 && rgb[2] >= 0 && (first || !mesh.colours.empty()))
      mesh.colours.push_back({static_cast<std::uint8_t>(rgb[0]), static_cast<std::uint8_t>(rgb[1]),
                              static_cast<std::uint8_t>(rgb[2])});
    mesh.positions.push_back(x);
    if (mesh.normals.size() != mesh.positions.size()) mesh.normals.clear();
    if (mesh.colours.size() != mesh.positions.size()) mesh.colours.clear();
  }

  void read_other(const PlyElement& element, TriangleMesh& mesh) {
    for (const PlyProperty& property : element.properties) {
      if (!property.count) {
        (void)number(property.type);
        continue;
      }
      const std::vector<std::uint32_t> corners = list(property);
      const bool is_face = property.name == "vertex_indices" || property.name == "vertex_index";
      if (element.name != "face" || !is_face) continue;
      for (std::size_t c = 2; c < corners.size(); ++c)
        mesh.triangles.push_back({corners[0], corners[c - 1], corners[c]});
    }
  }

  fs::path file_;
  std::string bytes_;
  std::size_t at_ = 0;
  bool ascii_ = false;
  std::vector<PlyElement> elements_;
};

}  // namespace

TriangleMesh read_ply_mesh(const fs::path& file) {
  return PlyReader(file).read();
}

}  // namespace twofold
