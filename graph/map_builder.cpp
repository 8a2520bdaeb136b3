#include "graph/map_builder.hpp"

#include <algorithm>

#include "graph/graph_writer.hpp"
#include "graph/map_entries.hpp"
#include "graph/part_extraction.hpp"

namespace twofold::map_format {

void MapBuilder::take_head(ByteReader in) {
  map_.rig = take_rig(in);
  (void)in.take<std::uint64_t>();  // version: of use to people only, a loaded map starts anew
  reference_ = KeyframeId{in.take<std::uint32_t>()};
  keyframe_count_ = in.take<std::uint32_t>();
  point_count_ = in.take<std::uint32_t>();
  in.expect_end();
  if (keyframe_count_ > kMaxCount || point_count_ > kMaxCount) throw FormatError{"announces too large a map"};
}

void MapBuilder::take_keyframes(ByteReader in) {
  for (std::uint32_t n = 0; n < kKeyframesPerSection && !in.at_end(); ++n) {
    if (keyframes_.size() == keyframe_count_) throw FormatError{"holds more keyframes than announced"};
    const KeyframeId id{static_cast<std::uint32_t>(keyframes_.size())};
    KeyframeEntry entry = version_ == 1 ? take_keyframe_1(in, id) : take_keyframe(in, id);
    const ObservationList& observations = *entry.keyframe.observations;
    if (!observations.empty() && index(observations.back().point) >= point_count_) {
      throw FormatError{"observes a point that is not there"};
    }
    if (entry.culled() && (!observations.empty() || !entry.edges.empty())) {
      throw FormatError{"holds a culled keyframe with observations or edges"};
    }
    keyframes_.push_back(std::move(entry));
  }
  in.expect_end();
}

void MapBuilder::take_points(ByteReader in) {
  for (std::uint32_t n = 0; n < kPointsPerSection && !in.at_end(); ++n) {
    if (points_.size() == point_count_) throw FormatError{"holds more points than announced"};
    points_.push_back(take_point(in));
  }
  in.expect_end();
}

void MapBuilder::take_places(ByteReader in) {
  for (std::uint32_t n = 0; n < kPlacesPerSection && !in.at_end(); ++n) {
    const KeyframeId id{in.take<std::uint32_t>()};
    if (index(id) < map_.places.size()) throw FormatError{"places out of order"};
    if (index(id) >= keyframe_count_) throw FormatError{"holds the place of a keyframe that is not there"};
    map_.places.set(id, take_place(in, map_.rig));
  }
  in.expect_end();
}

SavedMap MapBuilder::finish() {
  check_keyframes();
  check_replacements();
  check_points();
  check_places();
  register_observers();
  mirror_edges();
  return assemble();
}

void MapBuilder::check_keyframes() const {
  if (keyframes_.size() != keyframe_count_) throw FormatError{"keyframes: fewer than announced"};
  if (points_.size() != point_count_) throw FormatError{"points: fewer than announced"};
  if (reference_ == kNoKeyframe ? !keyframes_.empty() : index(reference_) >= keyframes_.size()) {
    throw FormatError{"head: the reference keyframe is not there"};
  }
  if (reference_ != kNoKeyframe && keyframes_[index(reference_)].culled()) {
    throw FormatError{"head: the reference keyframe was culled"};
  }
}

/// Each chain of replacements that is known must end in a keyframe that was not culled.
void MapBuilder::check_replacements() const {
  enum : std::uint8_t { kUnknown, kOnTheWay, kGood };
  std::vector<std::uint8_t> state(keyframes_.size(), kUnknown);
  std::vector<std::size_t> chain;
  for (std::size_t k = 0; k < keyframes_.size(); ++k) {
    if (keyframes_[k].forgotten()) continue;
    chain.clear();
    for (std::size_t at = k; state[at] != kGood;) {
      if (state[at] == kOnTheWay) throw FormatError{"keyframes: replacements go round in a circle"};
      state[at] = kOnTheWay;
      chain.push_back(at);
      if (!keyframes_[at].culled()) break;
      at = index(keyframes_[at].replacement.id);
      if (at >= keyframes_.size() || keyframes_[at].forgotten())
        throw FormatError{"keyframes: a replacement is not there"};
    }
    for (const std::size_t at : chain) state[at] = kGood;
  }
}

void MapBuilder::check_points() const {
  for (const MapPoint& point : points_) {
    if (!point.alive()) continue;
    if (index(point.anchor) >= keyframes_.size() || keyframes_[index(point.anchor)].forgotten())
      throw FormatError{"points: an anchor is not there"};
    if (!(point.psi.z() > 0)) throw FormatError{"points: a point is not in front of its anchor"};
    if (point.appearance == nullptr) throw FormatError{"points: a point has no appearance"};
  }
}

void MapBuilder::check_places() const {
  for (std::uint32_t k = 0; k < map_.places.size(); ++k) {
    if (map_.places.find(KeyframeId{k}) != nullptr && keyframes_[k].culled())
      throw FormatError{"places: a culled keyframe has a place"};
  }
}

void MapBuilder::register_observers() {
  observers_.resize(points_.size());
  for (const KeyframeEntry& entry : keyframes_) {
    const Keyframe& keyframe = entry.keyframe;
    for (const Observation& observation : *keyframe.observations) {
      if (!points_[index(observation.point)].alive())
        throw FormatError{"keyframes: a culled point is observed"};
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
void MapBuilder::mirror_edges() {
  for (std::size_t k = 0; k < keyframes_.size(); ++k) {
    const auto id = KeyframeId{static_cast<std::uint32_t>(k)};
    const EdgeList& edges = keyframes_[k].edges;
    const std::size_t own = edges.size();
    for (std::size_t n = 0; n < own && edges[n].other < id; ++n) {
      const Edge edge = edges[n];
      if (keyframes_[index(edge.other)].culled())
        throw FormatError{"keyframes: an edge to a culled keyframe"};
      Edge back = edge;
      back.other = id;
      back.T_other_this = edge.T_other_this.inverse();
      keyframes_[index(edge.other)].edges.push_back(back);  // newer ones come later: the list stays in order
    }
  }
}

SavedMap MapBuilder::assemble() {
  GraphWriter writer;
  for (std::size_t k = 0; k < keyframes_.size(); ++k) {
    auto& [keyframe, edges, replacement] = keyframes_[k];
    if (keyframe.culled()) {
      writer.add_culled_keyframe(replacement);
      continue;
    }
    keyframe.edges = std::make_shared<const EdgeList>(std::move(edges));
    writer.add_keyframe(std::move(keyframe));
  }
  for (std::size_t p = 0; p < points_.size(); ++p) {
    points_[p].observers = std::make_shared<const ObserverList>(std::move(observers_[p]));
    writer.add_point(PointId{static_cast<std::uint32_t>(p)}, std::move(points_[p]));
  }
  writer.set_reference(reference_);
  writer.keep_needed_replacements();  // nobody has asked this map for a keyframe yet
  name_parts(writer);
  map_.graph = writer.publish();
  return std::move(map_);
}

}  // namespace twofold::map_format
