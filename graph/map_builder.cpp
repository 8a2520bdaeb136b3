#include "graph/map_builder.hpp"

#include <algorithm>

#include "graph/graph_writer.hpp"
#include "graph/map_entries.hpp"
#include "graph/part_extraction.hpp"

namespace twofold::map_format {
namespace {

template <class Entries, class Id>
auto find_entry(Entries& entries, Id id) -> decltype(entries.data()) {
  const auto at = std::lower_bound(entries.begin(), entries.end(), id,
                                   [](const auto& entry, Id wanted) { return entry.id < wanted; });
  return at == entries.end() || at->id != id ? nullptr : &*at;
}

}  // namespace

void MapBuilder::take_head(EntryReader in) {
  map_.rig = take_rig(in);
  (void)in.u64();  // version: of use to people only, a loaded map starts anew
  reference_ = KeyframeId{in.u32()};
  keyframe_count_ = in.u32();
  point_count_ = in.u32();
  in.expect_end();
  if (keyframe_count_ > kMaxKeyframes || point_count_ > kMaxPoints)
    throw MalformedBytes("announces too large a map");
}

const KeyframeEntry* MapBuilder::find(KeyframeId id) const {
  return find_entry(keyframes_, id);
}
KeyframeEntry* MapBuilder::find(KeyframeId id) {
  return find_entry(keyframes_, id);
}
MapBuilder::PointEntry* MapBuilder::find(PointId id) {
  return find_entry(points_, id);
}

void MapBuilder::take_keyframes(EntryReader in) {
  for (std::uint32_t n = 0; n < kKeyframesPerSection && !in.at_end(); ++n) {
    const KeyframeId id{next_keyframe_};
    KeyframeEntry entry = version_ == 1 ? take_keyframe_1(in, id) : take_keyframe(in, id);
    const std::uint32_t run = version_ >= 3 && entry.forgotten() ? in.run() : 1;
    if (run > keyframe_count_ - next_keyframe_) throw MalformedBytes("holds more keyframes than announced");
    next_keyframe_ += run;
    const ObservationList& observations = *entry.keyframe.observations;
    if (!observations.empty() && index(observations.back().point) >= point_count_) {
      throw MalformedBytes("observes a point that is not there");
    }
    if (entry.culled() && (!observations.empty() || !entry.edges.empty())) {
      throw MalformedBytes("holds a culled keyframe with observations or edges");
    }
    if (!entry.forgotten()) keyframes_.push_back(std::move(entry));
  }
  in.expect_end();
}

void MapBuilder::take_points(EntryReader in) {
  for (std::uint32_t n = 0; n < kPointsPerSection && !in.at_end(); ++n) {
    PointEntry entry{PointId{next_point_}, take_point(in), {}};
    const std::uint32_t run = version_ >= 3 && entry.point.culled() ? in.run() : 1;
    if (run > point_count_ - next_point_) throw MalformedBytes("holds more points than announced");
    next_point_ += run;
    if (!entry.point.culled()) points_.push_back(std::move(entry));
  }
  in.expect_end();
}

void MapBuilder::take_places(EntryReader in) {
  for (std::uint32_t n = 0; n < kPlacesPerSection && !in.at_end(); ++n) {
    const KeyframeId id{in.u32()};
    if (index(id) < map_.places.size()) throw MalformedBytes("places out of order");
    if (index(id) >= keyframe_count_) throw MalformedBytes("holds the place of a keyframe that is not there");
    map_.places.set(id, take_place(in, map_.rig));
    places_.push_back(id);
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
  if (next_keyframe_ != keyframe_count_) throw MalformedBytes("keyframes: fewer than announced");
  if (next_point_ != point_count_) throw MalformedBytes("points: fewer than announced");
  if (reference_ == kNoKeyframe ? keyframe_count_ > 0 : index(reference_) >= keyframe_count_) {
    throw MalformedBytes("head: the reference keyframe is not there");
  }
  if (reference_ == kNoKeyframe) return;
  const KeyframeEntry* reference = find(reference_);
  if (reference == nullptr || reference->culled())
    throw MalformedBytes("head: the reference keyframe was culled");
}

/// Each chain of replacements that is known must end in a keyframe that was not culled.
void MapBuilder::check_replacements() const {
  enum : std::uint8_t { kUnknown, kOnTheWay, kGood };
  std::vector<std::uint8_t> state(keyframes_.size(), kUnknown);
  std::vector<std::size_t> chain;
  for (std::size_t k = 0; k < keyframes_.size(); ++k) {
    chain.clear();
    for (std::size_t at = k; state[at] != kGood;) {
      if (state[at] == kOnTheWay) throw MalformedBytes("keyframes: replacements go round in a circle");
      state[at] = kOnTheWay;
      chain.push_back(at);
      if (!keyframes_[at].culled()) break;
      const KeyframeEntry* next = find(keyframes_[at].replacement.id);
      if (next == nullptr) throw MalformedBytes("keyframes: a replacement is not there");
      at = static_cast<std::size_t>(next - keyframes_.data());
    }
    for (const std::size_t at : chain) state[at] = kGood;
  }
}

void MapBuilder::check_points() const {
  for (const PointEntry& entry : points_) {
    if (find(entry.point.anchor) == nullptr) throw MalformedBytes("points: an anchor is not there");
    if (!(entry.point.psi.z() > 0)) throw MalformedBytes("points: a point is not in front of its anchor");
    if (entry.point.appearance == nullptr) throw MalformedBytes("points: a point has no appearance");
  }
}

void MapBuilder::check_places() const {
  for (const KeyframeId id : places_) {
    const KeyframeEntry* entry = find(id);
    if (entry == nullptr || entry->culled()) throw MalformedBytes("places: a culled keyframe has a place");
  }
}

void MapBuilder::register_observers() {
  for (const KeyframeEntry& entry : keyframes_) {
    for (const Observation& observation : *entry.keyframe.observations) {
      PointEntry* point = find(observation.point);
      if (point == nullptr) throw MalformedBytes("keyframes: a culled point is observed");
      point->observers.push_back(entry.id);
    }
  }
  for (const PointEntry& entry : points_) {
    if (find(entry.point.anchor)->culled()) continue;
    if (!std::binary_search(entry.observers.begin(), entry.observers.end(), entry.point.anchor)) {
      throw MalformedBytes("points: an anchor does not observe its point");
    }
  }
}

/// Both keyframes of an edge keep it; the file has it once.
void MapBuilder::mirror_edges() {
  for (KeyframeEntry& entry : keyframes_) {
    const std::size_t own = entry.edges.size();
    for (std::size_t n = 0; n < own && entry.edges[n].other < entry.id; ++n) {
      const Edge edge = entry.edges[n];
      KeyframeEntry* other = find(edge.other);
      if (other == nullptr || other->culled())
        throw MalformedBytes("keyframes: an edge to a culled keyframe");
      Edge back = edge;
      back.other = entry.id;
      back.T_other_this = edge.T_other_this.inverse();
      other->edges.push_back(back);  // newer ones come later: the list stays in order
    }
  }
}

SavedMap MapBuilder::assemble() {
  GraphWriter writer;
  for (KeyframeEntry& entry : keyframes_) {
    writer.add_forgotten_keyframes(index(entry.id) - writer.graph().keyframe_count());
    if (entry.culled()) {
      writer.add_culled_keyframe(entry.replacement);
      continue;
    }
    entry.keyframe.edges = std::make_shared<const EdgeList>(std::move(entry.edges));
    writer.add_keyframe(std::move(entry.keyframe));
  }
  writer.add_forgotten_keyframes(keyframe_count_ - writer.graph().keyframe_count());
  for (PointEntry& entry : points_) {
    entry.point.observers = std::make_shared<const ObserverList>(std::move(entry.observers));
    writer.add_point(entry.id, std::move(entry.point));
  }
  writer.fill_with_culled_points(point_count_);
  writer.set_reference(reference_);
  writer.keep_needed_replacements();  // nobody has asked this map for a keyframe yet
  name_parts(writer);
  map_.graph = writer.publish();
  return std::move(map_);
}

}  // namespace twofold::map_format
