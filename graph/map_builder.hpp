#pragma once

#include <vector>

#include "graph/map_entries.hpp"
#include "graph/map_file.hpp"
#include "graph/map_format.hpp"

namespace twofold::map_format {

/// Puts a map together from the sections of its file, in any order after the head. Cross references are
/// checked when everything is there. Keyframes that are forgotten and points that are culled are counted and
/// not kept. All functions throw MalformedBytes.
class MapBuilder {
 public:
  /// Of the file, before anything is taken.
  void read_version(std::uint16_t version) { version_ = version; }
  void take_head(EntryReader in);
  void take_keyframes(EntryReader in);
  void take_points(EntryReader in);
  void take_places(EntryReader in);

  /// To be called once, after all sections.
  [[nodiscard]] SavedMap finish();

 private:
  struct PointEntry {
    PointId id = kNoPoint;
    MapPoint point;
    ObserverList observers;
  };
  /// Null: it is not there, or forgotten.
  [[nodiscard]] const KeyframeEntry* find(KeyframeId id) const;
  [[nodiscard]] KeyframeEntry* find(KeyframeId id);
  /// Null: it is not there, or culled.
  [[nodiscard]] PointEntry* find(PointId id);

  void check_keyframes() const;
  void check_replacements() const;
  void check_points() const;
  void check_places() const;
  void register_observers();
  void mirror_edges();
  [[nodiscard]] SavedMap assemble();

  SavedMap map_;
  std::uint16_t version_ = kMapFormatVersion;
  KeyframeId reference_ = kNoKeyframe;
  std::uint32_t keyframe_count_ = 0, point_count_ = 0;
  std::uint32_t next_keyframe_ = 0, next_point_ = 0;  // as many were taken
  std::vector<KeyframeEntry> keyframes_;              // in order of their ids, like the next two
  std::vector<PointEntry> points_;
  std::vector<KeyframeId> places_;
};

}  // namespace twofold::map_format
