#include "engine/mapper_inbox.hpp"

#include <gtest/gtest.h>

#include <thread>

namespace twofold {
namespace {

class MapperInboxTest : public ::testing::Test {
 protected:
  static constexpr std::size_t kProposals = 8, kARound = 4;
  static KeyframeId k(std::uint32_t id) { return KeyframeId{id}; }
  static LoopMessage loop_to(KeyframeId to) {
    LoopConstraint loop;
    loop.to = to;
    return loop;
  }

  void send(std::uint32_t first, std::uint32_t count) {
    for (std::uint32_t n = first; n < first + count; ++n) {
      ProposalHandle proposal = pool_.try_acquire();
      ASSERT_TRUE(proposal);
      proposal->id = k(n);
      inbox_.send(std::move(proposal));
    }
  }
  std::vector<KeyframeId> taken_proposals() {
    std::vector<KeyframeId> ids;
    for (const ProposalHandle& proposal : inbox_.proposals()) ids.push_back(proposal->id);
    return ids;
  }
  [[nodiscard]] std::vector<KeyframeId> taken_loops() const {
    std::vector<KeyframeId> ids;
    for (const LoopMessage& message : inbox_.loops()) ids.push_back(std::get<LoopConstraint>(message).to);
    return ids;
  }

  using Ids = std::vector<KeyframeId>;
  ProposalPool pool_{kProposals};
  MapperInbox inbox_{kProposals, kARound};
};

TEST_F(MapperInboxTest, GivesOutWhatWaitsOldestFirstAndARoundAtATime) {
  EXPECT_TRUE(inbox_.empty());
  EXPECT_FALSE(inbox_.take());
  send(0, 6);
  ASSERT_TRUE(inbox_.try_send(loop_to(k(3))));
  EXPECT_FALSE(inbox_.empty());
  EXPECT_EQ(inbox_.proposals_approx(), 6U);
  EXPECT_EQ(inbox_.loops_approx(), 1U);
  EXPECT_TRUE(inbox_.take());
  EXPECT_EQ(taken_proposals(), (Ids{k(0), k(1), k(2), k(3)}));
  EXPECT_EQ(taken_loops(), Ids{k(3)});
  EXPECT_TRUE(inbox_.take());
  EXPECT_EQ(taken_proposals(), (Ids{k(4), k(5)}));
  EXPECT_EQ(taken_loops(), Ids{});
  EXPECT_TRUE(inbox_.empty());
}

TEST_F(MapperInboxTest, GivesOutNoMoreThanIsAskedFor) {
  send(0, 4);
  for (std::uint32_t n = 0; n < 3; ++n) ASSERT_TRUE(inbox_.try_send(loop_to(k(n))));
  EXPECT_TRUE(inbox_.take(1, 2));
  EXPECT_EQ(taken_proposals(), Ids{k(0)});
  EXPECT_EQ(taken_loops(), (Ids{k(0), k(1)}));
  EXPECT_TRUE(inbox_.take(0, 2));
  EXPECT_EQ(taken_proposals(), Ids{});
  EXPECT_EQ(taken_loops(), Ids{k(2)});
}

TEST_F(MapperInboxTest, EveryProposalOfThePoolFits) {
  send(0, kProposals);
  EXPECT_EQ(inbox_.proposals_approx(), kProposals);
  EXPECT_FALSE(pool_.try_acquire());
  ASSERT_TRUE(inbox_.take());
  inbox_.proposals()[0].reset();
  EXPECT_TRUE(pool_.try_acquire());
}

TEST_F(MapperInboxTest, ALoopWithoutRoomStaysWithItsSender) {
  for (std::uint32_t n = 0; n < kARound; ++n) {
    EXPECT_EQ(inbox_.room_for_loops(), kARound - n);
    ASSERT_TRUE(inbox_.try_send(loop_to(k(n))));
  }
  LoopMessage late = loop_to(k(9));
  EXPECT_FALSE(inbox_.try_send(std::move(late)));
  // NOLINTNEXTLINE(bugprone-use-after-move): try_send leaves what it refuses
  EXPECT_EQ(std::get<LoopConstraint>(late).to, k(9));
  ASSERT_TRUE(inbox_.take());
  EXPECT_EQ(inbox_.room_for_loops(), kARound);
  EXPECT_TRUE(inbox_.try_send(std::move(late)));
}

/// A tracker, a loop closer and a mapper: what each of them sends comes in its order, and nothing is lost.
TEST_F(MapperInboxTest, TwoThreadsSendAndAThirdTakes) {
  constexpr std::uint32_t kSent = 5000;
  std::jthread tracker([this] {
    for (std::uint32_t n = 0; n < kSent;) {
      ProposalHandle proposal = pool_.try_acquire();
      if (!proposal) {
        std::this_thread::yield();
        continue;
      }
      proposal->id = k(n++);
      inbox_.send(std::move(proposal));
    }
  });
  std::jthread loop_closer([this] {
    for (std::uint32_t n = 0; n < kSent; ++n) {
      LoopMessage loop = loop_to(k(n));
      while (!inbox_.try_send(std::move(loop))) std::this_thread::yield();
    }
  });
  std::uint32_t proposals = 0, loops = 0, out_of_order = 0;
  while (proposals < kSent || loops < kSent) {
    if (!inbox_.take()) std::this_thread::yield();
    for (ProposalHandle& proposal : inbox_.proposals()) {
      out_of_order += proposal->id != k(proposals++) ? 1 : 0;
      proposal.reset();
    }
    for (const KeyframeId loop : taken_loops()) out_of_order += loop != k(loops++) ? 1 : 0;
  }
  EXPECT_EQ(out_of_order, 0U);
  EXPECT_TRUE(inbox_.empty());
}

}  // namespace
}  // namespace twofold
