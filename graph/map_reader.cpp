#include <zlib.h>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <istream>

#include "graph/graph_writer.hpp"
#include "graph/map_file.hpp"
#include "graph/map_format.hpp"

namespace twofold {
namespace {

using namespace map_format;

struct RawSection {
  std::uint32_t id = 0;
  std::vector<std::uint8_t> bytes;
};

/// Reads sections from a stream whose size is known.
class SectionReader {
 public:
  SectionReader(std::istream& in, std::uint64_t size) : in_(in), left_(size) {}

  void read_header() {
    std::array<std::uint8_t, kHeaderBytes> header;
    if (left_ < header.size()) throw FormatError{"too short to be a map"};
    read(header);
    if (std::memcmp(header.data(), kMagic.data(), kMagic.size()) != 0) throw FormatError{"not a map file"};
    std::uint16_t version = 0;
    std::memcpy(&version, header.data() + kMagic.size(), sizeof version);
    if (version != kMapFormatVersion) {
      throw FormatError{"written in format version " + std::to_string(version) + ", this program reads " +
                        std::to_string(kMapFormatVersion)};
    }
  }

  void next(RawSection& section) {
    std::array<std::uint8_t, kSectionHeadBytes> head;
    if (left_ < head.size()) throw FormatError{"the file is cut short before its end section"};
    read(head);
    std::uint64_t length = 0;
    std::memcpy(&section.id, head.data(), 4);
    std::memcpy(&length, head.data() + 4, 8);
    if (left_ < 4 || length > left_ - 4) throw FormatError{"reaches beyond the end of the file: it is cut short"};
    section.bytes.resize(length);
    read(section.bytes);
    std::array<std::uint8_t, 4> tail;
    read(tail);
    uLong crc = crc32(0, head.data(), static_cast<uInt>(head.size()));
    crc = crc32_z(crc, section.bytes.data(), section.bytes.size());
    std::uint32_t written = 0;
    std::memcpy(&written, tail.data(), 4);
    if (written != static_cast<std::uint32_t>(crc)) throw FormatError{"checksum is wrong, the file is damaged"};
  }

  [[nodiscard]] std::uint64_t left() const { return left_; }

 private:
  void read(std::span<std::uint8_t> bytes) {
    in_.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    if (!in_) throw FormatError{"cannot be read"};
    left_ -= bytes.size();
  }

  std::istream& in_;
  std::uint64_t left_;
};

/// Puts the graph together; all cross references are checked when everything is there.
class MapBuilder {
 public:
  void take_head(ByteReader in) {
    Rig& rig = map_.rig;
    rig.kind = static_cast<SensorKind>(in.take_small(3, "kind of sensor"));
    PinholeCamera& c = rig.camera;
    for (double* value : {&c.fx, &c.fy, &c.cx, &c.cy}) *value = in.take_finite();
    c.width = in.take<std::int32_t>();
    c.height = in.take<std::int32_t>();
    if (c.width < 1 || c.height < 1 || !(c.fx > 0) || !(c.fy > 0)) throw FormatError{"holds an impossible camera"};
    for (double* value : {&rig.baseline, &rig.depth_unit, &rig.depth_min, &rig.depth_max}) {
      *value = in.take_finite();
    }
    (void)in.take<std::uint64_t>();  // version: of use to people only, a loaded map starts anew
    reference_ = KeyframeId{in.take<std::uint32_t>()};
    keyframe_count_ = in.take<std::uint32_t>();
    point_count_ = in.take<std::uint32_t>();
    in.expect_end();
    if (keyframe_count_ > kMaxCount || point_count_ > kMaxCount) throw FormatError{"announces too large a map"};
  }

  void take_keyframes(ByteReader in) {
    for (std::uint32_t n = 0; n < kKeyframesPerSection && !in.at_end(); ++n) take_keyframe(in);
    in.expect_end();
  }
  void take_points(ByteReader in) {
    for (std::uint32_t n = 0; n < kPointsPerSection && !in.at_end(); ++n) take_point(in);
    in.expect_end();
  }
  void take_places(const std::vector<std::uint8_t>& bytes) { map_.places = bytes; }

  SavedMap finish() {
    if (keyframes_.size() != keyframe_count_) throw FormatError{"fewer keyframes than announced"};
    if (points_.size() != point_count_) throw FormatError{"fewer points than announced"};
    check_heirs();
    check_points();
    register_observers();
    mirror_edges();
    return assemble();
  }

 private:
  void take_keyframe(ByteReader& in) {
    if (keyframes_.size() == keyframe_count_) throw FormatError{"holds more keyframes than announced"};
    Keyframe keyframe;
    keyframe.id = KeyframeId{static_cast<std::uint32_t>(keyframes_.size())};
    keyframe.frame_index = in.take<std::int64_t>();
    keyframe.t_ns = in.take<std::int64_t>();
    keyframe.T_k_w = in.take_pose();
    keyframe.median_depth = in.take_finite();
    keyframe.heir = KeyframeId{in.take<std::uint32_t>()};
    keyframe.T_this_heir = in.take_pose();
    keyframe.observations = take_observations(in);
    edges_.push_back(take_edges(in, keyframe.id));
    if (keyframe.culled() && (!keyframe.observations->empty() || !edges_.back().empty())) {
      throw FormatError{"holds a culled keyframe with observations or edges"};
    }
    keyframes_.push_back(std::move(keyframe));
  }

  std::shared_ptr<const ObservationList> take_observations(ByteReader& in) {
    constexpr std::size_t kBytes = 4 + 3 * 4 + 1;
    auto list = std::make_shared<ObservationList>(in.take_count(kBytes));
    for (std::size_t n = 0; n < list->size(); ++n) {
      Observation& observation = (*list)[n];
      observation.point = PointId{in.take<std::uint32_t>()};
      for (int i = 0; i < 3; ++i) observation.z[i] = in.take<float>();
      observation.level = in.take_small(16, "pyramid level");
      if (index(observation.point) >= point_count_) throw FormatError{"observes a point that is not there"};
      if (!std::isfinite(observation.z.x()) || !std::isfinite(observation.z.y()) ||
          std::isinf(observation.z.z())) {
        throw FormatError{"holds a measurement that is not finite"};
      }
      if (n > 0 && !((*list)[n - 1].point < observation.point)) throw FormatError{"observations out of order"};
    }
    return list;
  }

  EdgeList take_edges(ByteReader& in, KeyframeId id) {
    constexpr std::size_t kBytes = 4 + 4 + 1 + 7 * 8 + 8;
    EdgeList list(in.take_count(kBytes));
    for (std::size_t n = 0; n < list.size(); ++n) {
      Edge& edge = list[n];
      edge.other = KeyframeId{in.take<std::uint32_t>()};
      edge.weight = in.take<std::int32_t>();
      edge.marginalised = in.take_small(2, "flag") != 0;
      edge.T_other_this = in.take_pose();
      edge.parallax = in.take_finite();
      if (!(edge.other < id)) throw FormatError{"holds an edge to a keyframe that is not there"};
      if (n > 0 && !(list[n - 1].other < edge.other)) throw FormatError{"edges out of order"};
      if (edge.weight < 0) throw FormatError{"holds an edge of negative weight"};
    }
    return list;
  }

  void take_point(ByteReader& in) {
    if (points_.size() == point_count_) throw FormatError{"holds more points than announced"};
    MapPoint point;
    point.anchor = KeyframeId{in.take<std::uint32_t>()};
    if (point.alive()) {
      point.psi = in.take_vector3();
      if (in.take_small(2, "flag") != 0) {
        auto appearance = std::make_shared<PointAppearance>();
        for (int i = 0; i < 2; ++i) appearance->uv[i] = in.take<float>();
        appearance->level = in.take_small(16, "pyramid level");
        if (!appearance->uv.allFinite()) throw FormatError{"holds a position that is not finite"};
        const auto pixels = in.take_bytes(appearance->pixels.size());
        std::copy(pixels.begin(), pixels.end(), appearance->pixels.begin());
        point.appearance = std::move(appearance);
      }
    }
    points_.push_back(std::move(point));
  }

  /// Each chain of heirs must end in a keyframe that was not culled.
  void check_heirs() const {
    enum : std::uint8_t { kUnknown, kOnTheWay, kGood };
    std::vector<std::uint8_t> state(keyframes_.size(), kUnknown);
    std::vector<std::size_t> chain;
    for (std::size_t k = 0; k < keyframes_.size(); ++k) {
      chain.clear();
      for (std::size_t at = k; state[at] != kGood;) {
        if (state[at] == kOnTheWay) throw FormatError{"keyframes: heirs go round in a circle"};
        state[at] = kOnTheWay;
        chain.push_back(at);
        if (!keyframes_[at].culled()) break;
        if (index(keyframes_[at].heir) >= keyframes_.size()) throw FormatError{"keyframes: an heir is not there"};
        at = index(keyframes_[at].heir);
      }
      for (const std::size_t at : chain) state[at] = kGood;
    }
    if (reference_ == kNoKeyframe ? !keyframes_.empty() : index(reference_) >= keyframes_.size()) {
      throw FormatError{"head: the reference keyframe is not there"};
    }
    if (reference_ != kNoKeyframe && keyframes_[index(reference_)].culled()) {
      throw FormatError{"head: the reference keyframe was culled"};
    }
  }

  void check_points() const {
    for (const MapPoint& point : points_) {
      if (!point.alive()) continue;
      if (index(point.anchor) >= keyframes_.size()) throw FormatError{"points: an anchor is not there"};
      if (!(point.psi.z() > 0)) throw FormatError{"points: a point is not in front of its anchor"};
      if (point.appearance == nullptr) throw FormatError{"points: a point has no appearance"};
    }
  }

  void register_observers() {
    observers_.resize(points_.size());
    for (const Keyframe& keyframe : keyframes_) {
      for (const Observation& observation : *keyframe.observations) {
        if (!points_[index(observation.point)].alive()) {
          throw FormatError{"keyframes: a culled point is observed"};
        }
        observers_[index(observation.point)].push_back(keyframe.id);
      }
    }
    for (std::size_t p = 0; p < points_.size(); ++p) {
      if (!points_[p].alive() || keyframes_[index(points_[p].anchor)].culled()) continue;
      if (!std::binary_search(observers_[p].begin(), observers_[p].end(), points_[p].anchor)) {
        throw FormatError{"points: an anchor does not observe its point"};
      }
    }
  }

  /// Both keyframes of an edge keep it; the file has it once.
  void mirror_edges() {
    for (std::size_t k = 0; k < edges_.size(); ++k) {
      const auto id = KeyframeId{static_cast<std::uint32_t>(k)};
      const std::size_t own = edges_[k].size();
      for (std::size_t n = 0; n < own && edges_[k][n].other < id; ++n) {
        const Edge edge = edges_[k][n];
        if (keyframes_[index(edge.other)].culled()) throw FormatError{"keyframes: an edge to a culled keyframe"};
        Edge back = edge;
        back.other = id;
        back.T_other_this = edge.T_other_this.inverse();
        edges_[index(edge.other)].push_back(back);  // newer ones come later: the list stays in order
      }
    }
  }

  SavedMap assemble() {
    GraphWriter writer;
    for (std::size_t k = 0; k < keyframes_.size(); ++k) {
      keyframes_[k].edges = std::make_shared<const EdgeList>(std::move(edges_[k]));
      writer.add_keyframe(std::move(keyframes_[k]));
    }
    for (std::size_t p = 0; p < points_.size(); ++p) {
      points_[p].observers = std::make_shared<const ObserverList>(std::move(observers_[p]));
      writer.add_point(PointId{static_cast<std::uint32_t>(p)}, std::move(points_[p]));
    }
    writer.set_reference(reference_);
    map_.graph = writer.publish();
    return std::move(map_);
  }

  SavedMap map_;
  KeyframeId reference_ = kNoKeyframe;
  std::uint32_t keyframe_count_ = 0, point_count_ = 0;
  std::vector<Keyframe> keyframes_;
  std::vector<EdgeList> edges_;  // by keyframe
  std::vector<MapPoint> points_;
  std::vector<ObserverList> observers_;  // by point
};

/// @return false at the end section
bool take_section(const RawSection& raw, bool first, MapBuilder& builder) {
  const auto section = static_cast<Section>(raw.id);
  if (first != (section == Section::kHead)) throw FormatError{"is not where it belongs"};
  switch (section) {
    case Section::kHead:
      builder.take_head(ByteReader(raw.bytes));
      return true;
    case Section::kKeyframes:
      builder.take_keyframes(ByteReader(raw.bytes));
      return true;
    case Section::kPoints:
      builder.take_points(ByteReader(raw.bytes));
      return true;
    case Section::kPlaces:
      builder.take_places(raw.bytes);
      return true;
    case Section::kEnd:
      ByteReader(raw.bytes).expect_end();
      return false;
  }
  if ((raw.id & kSkippable) == 0) throw FormatError{"is of a kind this program does not know"};
  return true;
}

}  // namespace

SavedMap read_map(std::istream& in, std::uint64_t size, const std::string& name) {
  SectionReader reader(in, size);
  MapBuilder builder;
  RawSection section;
  int number = 0;
  try {
    reader.read_header();
    do {
      number += 1;
      section.id = ~0U;
      reader.next(section);
    } while (take_section(section, number == 1, builder));
    number = 0;
    if (reader.left() > 0) throw FormatError{"bytes follow after the end section"};
    return builder.finish();
  } catch (const FormatError& error) {
    if (number == 0) throw MapFileError(name + ": " + error.what);
    const std::string which =
        section.id == ~0U ? "" : std::string(" (") + name_of(static_cast<Section>(section.id)) + ")";
    throw MapFileError(name + ": section " + std::to_string(number) + which + ": " + error.what);
  }
}

SavedMap load_map(const std::filesystem::path& file) {
  std::error_code error;
  const auto size = std::filesystem::file_size(file, error);
  std::ifstream in(file, std::ios::binary);
  if (error || !in) throw MapFileError(file.string() + ": cannot be opened");
  return read_map(in, size, file.string());
}

}  // namespace twofold
