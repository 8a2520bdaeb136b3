#pragma once

#include <vector>

#include "graph/map_entries.hpp"
#include "graph/map_file.hpp"
#include "graph/map_format.hpp"

namespace twofold::map_format {

/// Puts a map together from the sections of its file, in any order after the head. Cross references are
/// checked when everything is there. All functions throw FormatError.
class MapBuilder {
 public:
  /// Of the file, before anything is taken.
  void read_version(std::uint16_t version) { version_ = version; }
  void take_head(ByteReader in);
  void take_keyframes(ByteReader in);
  void take_points(ByteReader in);
  void take_places(ByteReader in);

  /// To be called once, after all sections.
  [[nodiscard]] SavedMap finish();

 private:
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
  std::vector<KeyframeEntry> keyframes_;
  std::vector<MapPoint> points_;
  std::vector<ObserverList> observers_;  // by point
};

}  // namespace twofold::map_format
