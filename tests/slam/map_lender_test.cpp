#include "slam/map_lender.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "graph/graph_writer.hpp"
#include "slam/map_snapshot.hpp"

namespace twofold {
namespace {

constexpr std::uint32_t kKeyframes = 70;  // more than two leaves of the tree

/// Every keyframe stands at x = number.
void set_all(GraphWriter& writer, double number) {
  for (std::uint32_t k = 0; k < kKeyframes; ++k) {
    writer.set_pose(KeyframeId{k}, SE3(SO3(), Vector3(number, 0, 0)));
  }
}

GraphWriter writer_with_keyframes() {
  GraphWriter writer;
  for (std::uint32_t k = 0; k < kKeyframes; ++k) {
    Keyframe keyframe;
    keyframe.id = KeyframeId{k};
    writer.add_keyframe(std::move(keyframe));
  }
  return writer;
}

/// x of all keyframes, NaN when they differ.
double number_of(const MapVersion& map) {
  const double first = map.graph.keyframe(KeyframeId{0}).T_k_w.translation().x();
  for (std::uint32_t k = 1; k < kKeyframes; ++k) {
    if (map.graph.keyframe(KeyframeId{k}).T_k_w.translation().x() != first) return std::nan("");
  }
  return first;
}

TEST(MapLender, LendsTheNewestVersionAndCountsWhatIsHeld) {
  MapLender lender;
  EXPECT_EQ(lender.newest()->graph.keyframe_count(), 0U);
  GraphWriter writer = writer_with_keyframes();
  set_all(writer, 1);
  DoubleWindow window;
  window.nodes.resize(3);
  for (std::uint32_t n = 0; n < 3; ++n) window.nodes[n].id = KeyframeId{n};
  window.inner = 1;
  lender.publish(writer.publish(), window);
  const auto first = lender.newest();
  EXPECT_EQ(first->inner_window, std::vector<KeyframeId>{KeyframeId{0}});
  EXPECT_EQ(first->outer_window, (std::vector<KeyframeId>{KeyframeId{1}, KeyframeId{2}}));
  EXPECT_EQ(lender.newest(), first) << "nothing newer was published";
  EXPECT_EQ(lender.held().versions, 1U);
  set_all(writer, 2);
  lender.publish(writer.publish(), window);
  auto second = lender.newest();
  EXPECT_EQ(number_of(*first), 1);
  EXPECT_EQ(number_of(*second), 2);
  EXPECT_EQ(lender.held().versions, 2U);
  EXPECT_EQ(lender.held().oldest, first->graph.version());
  second.reset();
  EXPECT_EQ(lender.held().versions, 1U);
}

/// Borrowers that come and go count the uses of one loan, and not, each anew, those of the map's nodes.
TEST(MapLender, ALoanThatNobodyHoldsAnyMoreIsLentAgain) {
  MapLender lender;
  GraphWriter writer = writer_with_keyframes();
  lender.publish(writer.publish(), {});
  const std::weak_ptr<const MapVersion> loan = lender.newest();
  EXPECT_FALSE(loan.expired());
  EXPECT_EQ(lender.newest(), loan.lock());
  EXPECT_EQ(lender.held().versions, 0U) << "only the lender has it";
  lender.publish(writer.publish(), {});
  EXPECT_NE(lender.newest(), loan.lock());
  EXPECT_TRUE(loan.expired());
}

TEST(MapLender, PlacesComeWithTheMap) {
  MapLender lender;
  const auto before = lender.newest();
  KeyframeDatabase places;
  places.set(KeyframeId{4}, PlaceAppearance{});
  lender.publish(places);
  lender.publish(places);  // the same version again: nothing happens
  EXPECT_NE(lender.newest()->places.find(KeyframeId{4}), nullptr);
  EXPECT_EQ(before->places.find(KeyframeId{4}), nullptr);
}

// Borrowers copy and destroy versions while the writer changes its own, whose nodes they share.
TEST(MapLender, VersionsStayWholeWhileTheWriterGoesOn) {
  constexpr int kVersions = 2000;
  MapLender lender;
  GraphWriter writer = writer_with_keyframes();
  lender.publish(writer.publish(), {});
  std::atomic<bool> done{false};
  std::atomic<int> broken{0};
  std::vector<std::thread> borrowers;
  for (int b = 0; b < 2; ++b) {
    borrowers.emplace_back([&, b] {
      std::vector<std::shared_ptr<const MapVersion>> kept;
      while (!done.load(std::memory_order_relaxed)) {
        kept.push_back(lender.newest());
        for (const auto& map : kept) broken += std::isnan(number_of(*map));
        if (kept.size() > static_cast<std::size_t>(3 + b)) kept.erase(kept.begin());
      }
    });
  }
  for (int v = 1; v <= kVersions; ++v) {
    set_all(writer, v);
    lender.publish(writer.publish(), {});
  }
  done.store(true, std::memory_order_relaxed);
  for (std::thread& borrower : borrowers) borrower.join();
  EXPECT_EQ(broken, 0);
  EXPECT_EQ(number_of(*lender.newest()), kVersions);
}

TEST(MapLender, LendsTheLoopsThatWereClosedSoFar) {
  MapLender lender;
  const auto before = lender.newest();
  ClosedLoop loop;
  loop.constraint.from = KeyframeId{3};
  loop.constraint.to = KeyframeId{60};
  loop.constraint.T_to_from = SE3(SO3(), Vector3(0, 0, 2));
  loop.constraint.scale = 1.25;
  loop.T_to_from_before = SE3(SO3(), Vector3(0, 0, 1.5));
  loop.travelled = 40;
  lender.publish(loop);
  loop.joins_parts = true;
  lender.publish(loop);
  EXPECT_TRUE(before->loops.empty());
  const MapSnapshot map(std::make_shared<const MapSnapshot::Impl>(MapSnapshot::Impl{{}, lender.newest()}));
  const auto loops = map.loops();
  ASSERT_EQ(loops.size(), 2U);
  EXPECT_EQ(loops[0].from, 3U);
  EXPECT_EQ(loops[0].to, 60U);
  EXPECT_EQ(loops[0].scale, 1.25);
  EXPECT_NEAR(loops[0].drift, 0.5, 1e-12);
  EXPECT_EQ(loops[0].travelled, 40);
  EXPECT_TRUE(loops[1].joins_parts);
  EXPECT_EQ(loops[1].drift, 0) << "two worlds have nothing to do with each other";
}

/// A keyframe that looks somewhere else than the older one: how it was turned wrongly must not be told as a
/// way.
TEST(MapLender, DriftIsByHowMuchAPositionWasWrong) {
  const auto stands = [](double turned, const Vector3& centre) {
    const SE3 T_from_to(SO3::exp(Vector3(0, turned, 0)), centre);
    return T_from_to.inverse();
  };
  ClosedLoop loop;
  loop.constraint.T_to_from = stands(2.0, Vector3(4, 0, -3));
  loop.T_to_from_before = stands(0.8, Vector3(4.3, 0, -2.6));
  MapLender lender;
  lender.publish(loop);
  const MapSnapshot map(std::make_shared<const MapSnapshot::Impl>(MapSnapshot::Impl{{}, lender.newest()}));
  ASSERT_EQ(map.loops().size(), 1U);
  EXPECT_NEAR(map.loops()[0].drift, 0.5, 1e-12);
  EXPECT_NEAR(map.loops()[0].turned, 1.2, 1e-12);
}

// A program that looked at the map once must not keep that version for the rest of its run.
TEST(MapLender, CatchingUpLetsGoOfWhatWasLentLast) {
  MapLender lender;
  GraphWriter writer = writer_with_keyframes();
  writer.set_reference(KeyframeId{0});
  Edge edge;
  edge.other = KeyframeId{0};
  writer.set_edge(KeyframeId{1}, edge);
  lender.publish(writer.publish(), {});
  const std::weak_ptr<const EdgeList> lent = lender.newest()->graph.keyframe(KeyframeId{1}).edges;
  writer.cull_keyframe(KeyframeId{1}, KeyframeId{0});
  lender.publish(writer.publish(), {});
  lender.publish(writer.publish(), {});
  ASSERT_FALSE(lent.expired()) << "the borrowers' side still has it: that is what catch_up is for";
  lender.catch_up();
  EXPECT_TRUE(lent.expired());
}

TEST(MapLender, VersionsShareTheLoopsTheyHaveInCommon) {
  MapLender lender;
  for (int n = 0; n < 20; ++n) lender.publish(ClosedLoop{});
  const auto before = lender.newest();
  lender.publish(ClosedLoop{});
  const auto after = lender.newest();
  EXPECT_EQ(before->loops.size(), 20U);
  EXPECT_EQ(after->loops.size(), 21U);
  EXPECT_EQ(&before->loops[0], &after->loops[0]);
}

}  // namespace
}  // namespace twofold
