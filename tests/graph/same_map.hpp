#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "graph/map_file.hpp"

namespace twofold::testing {

inline void expect_same(const KeyframeDatabase& a, const KeyframeDatabase& b) {
  for (std::uint32_t k = 0; k < std::max(a.size(), b.size()); ++k) {
    const PlaceAppearance* p = a.find(KeyframeId{k});
    const PlaceAppearance* q = b.find(KeyframeId{k});
    ASSERT_EQ(p == nullptr, q == nullptr) << k;
    if (p == nullptr) continue;
    ASSERT_EQ(p->corners.size(), q->corners.size());
    ASSERT_EQ(p->pixels.size(), q->pixels.size());
    for (std::size_t n = 0; n < p->corners.size(); ++n) {
      EXPECT_EQ(p->corners[n].uv, q->corners[n].uv);
      EXPECT_EQ(p->corners[n].level, q->corners[n].level);
      EXPECT_EQ(p->corners[n].angle, q->corners[n].angle);
      EXPECT_EQ(p->corners[n].descriptor, q->corners[n].descriptor);
      EXPECT_EQ(p->pixels[n].head<2>(), q->pixels[n].head<2>());
      EXPECT_TRUE(p->pixels[n].z() == q->pixels[n].z() ||
                  (std::isnan(p->pixels[n].z()) && std::isnan(q->pixels[n].z())));
    }
  }
}

/// @param rounding  of points that were computed by another program
inline void expect_same(const SavedMap& a, const SavedMap& b, double rounding = 0) {
  EXPECT_EQ(a.rig.kind, b.rig.kind);
  EXPECT_EQ(a.rig.camera.fy, b.rig.camera.fy);
  EXPECT_EQ(a.rig.baseline, b.rig.baseline);
  expect_same(a.places, b.places);
  EXPECT_EQ(a.graph.reference(), b.graph.reference());
  ASSERT_EQ(a.graph.keyframe_count(), b.graph.keyframe_count());
  ASSERT_EQ(a.graph.point_count(), b.graph.point_count());
  for (std::uint32_t i = 0; i < a.graph.keyframe_count(); ++i) {
    const Keyframe& k = a.graph.keyframe(KeyframeId{i});
    const Keyframe& l = b.graph.keyframe(KeyframeId{i});
    EXPECT_EQ(k.id, l.id);
    EXPECT_EQ(k.t_ns, l.t_ns);
    EXPECT_EQ(k.frame_index, l.frame_index);
    if (k.culled()) {
      const Replacement& h = a.graph.replacement(KeyframeId{i});
      EXPECT_EQ(h.id, b.graph.replacement(KeyframeId{i}).id);
      EXPECT_LT((h.T_this_replacement.unpacked().matrix() -
                 b.graph.replacement(KeyframeId{i}).T_this_replacement.unpacked().matrix())
                    .norm(),
                1e-13);
    }
    EXPECT_EQ(k.culled(), l.culled());
    EXPECT_LT((k.T_k_w.matrix() - l.T_k_w.matrix()).norm(), 1e-13);
    ASSERT_EQ(k.observations->size(), l.observations->size());
    for (std::size_t n = 0; n < k.observations->size(); ++n) {
      const Observation& o = (*k.observations)[n];
      const Observation& q = (*l.observations)[n];
      EXPECT_EQ(o.point, q.point);
      EXPECT_EQ(o.pixel.head<2>(), q.pixel.head<2>());
      EXPECT_TRUE(o.pixel.z() == q.pixel.z() || (std::isnan(o.pixel.z()) && std::isnan(q.pixel.z())));
      EXPECT_EQ(o.level, q.level);
    }
    ASSERT_EQ(k.edges->size(), l.edges->size());
    for (std::size_t n = 0; n < k.edges->size(); ++n) {
      EXPECT_EQ((*k.edges)[n].other, (*l.edges)[n].other);
      EXPECT_EQ((*k.edges)[n].weight, (*l.edges)[n].weight);
      EXPECT_EQ((*k.edges)[n].marginalised, (*l.edges)[n].marginalised);
      EXPECT_LT(((*k.edges)[n].T_other_this.matrix() - (*l.edges)[n].T_other_this.matrix()).norm(), 1e-12);
    }
  }
  for (std::uint32_t i = 0; i < a.graph.point_count(); ++i) {
    const MapPoint& p = a.graph.point(PointId{i});
    const MapPoint& q = b.graph.point(PointId{i});
    ASSERT_EQ(p.anchor, q.anchor);
    if (p.culled()) continue;
    EXPECT_LE((p.psi - q.psi).norm(), rounding);
    EXPECT_EQ(p.appearance->pixels, q.appearance->pixels);
    EXPECT_EQ(p.appearance->uv, q.appearance->uv);
    EXPECT_EQ(*p.observers, *q.observers);
  }
}

}  // namespace twofold::testing
