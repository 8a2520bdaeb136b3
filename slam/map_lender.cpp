#include "slam/map_lender.hpp"

#include <algorithm>

namespace twofold {

void MapLender::publish(const GraphSnapshot& graph, const DoubleWindow& window) {
  MapVersion map;
  map.graph = graph;
  for (std::size_t n = 0; n < window.nodes.size(); ++n) {
    (n < window.inner ? map.inner_window : map.outer_window).push_back(window.nodes[n].id);
  }
  maps_.publish(std::move(map));
}

void MapLender::publish(const ClosedLoop& loop) {
  all_loops_.loops.push_back(loop);
  loops_.publish(all_loops_);
}

std::shared_ptr<const MapVersion> MapLender::newest() {
  const std::scoped_lock lock(borrowers_);
  const MapVersion& map = maps_.mailbox(0).latest();
  const KeyframeDatabase& places = places_.mailbox(0).latest();
  const LoopList& loops = loops_.mailbox(0).latest();
  std::erase_if(loans_, [](const auto& loan) { return loan.expired(); });
  if (!loans_.empty()) {
    auto last = loans_.back().lock();
    if (last && last->version() == map.version() && last->places.version() == places.version() &&
        last->loops.version() == loops.version())
      return last;
  }
  auto loan = std::make_shared<MapVersion>(map);
  loan->places = places;
  loan->loops = loops;
  loans_.push_back(loan);
  return loan;
}

void MapLender::catch_up() {
  const std::unique_lock lock(borrowers_, std::try_to_lock);
  if (!lock) return;
  (void)maps_.mailbox(0).latest();
  (void)places_.mailbox(0).latest();
  (void)loops_.mailbox(0).latest();
}

MapLender::Loans MapLender::held() {
  const std::scoped_lock lock(borrowers_);
  Loans loans;
  for (const auto& weak : loans_) {
    const auto loan = weak.lock();
    if (!loan) continue;
    ++loans.versions;
    const std::uint64_t version = loan->graph.version();
    if (loans.versions == 1 || version < loans.oldest) loans.oldest = version;
  }
  return loans;
}

}  // namespace twofold
