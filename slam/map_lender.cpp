#include "slam/map_lender.hpp"

#include <algorithm>
#include <utility>

namespace twofold {

void MapLender::publish(const GraphSnapshot& graph, const DoubleWindow& window) {
  auto map = std::make_unique<MapVersion>();
  map->graph = graph;
  map->inner_window.reserve(window.inner);
  map->outer_window.reserve(window.nodes.size() - window.inner);
  for (std::size_t n = 0; n < window.nodes.size(); ++n) {
    (n < window.inner ? map->inner_window : map->outer_window).push_back(window.nodes[n].id);
  }
  maps_.put(std::move(map));
}

void MapLender::publish(const KeyframeDatabase& places) {
  if (places.version() == places_version_) return;
  places_version_ = places.version();
  places_.put(std::make_unique<KeyframeDatabase>(places));
}

void MapLender::publish(const ClosedLoop& loop) {
  all_loops_.push_back(loop);
  loops_.put(std::make_unique<LoopList>(all_loops_));
}

MapLender::Replaced MapLender::take_newest() {
  Replaced replaced;
  const auto map = maps_.take();
  const auto places = places_.take();
  const auto loops = loops_.take();
  if (!map && !places && !loops) return replaced;
  replaced.loan = std::move(loan_);
  if (map) {
    replaced.version.graph = std::exchange(newest_.graph, std::move(map->graph));
    newest_.inner_window = std::move(map->inner_window);
    newest_.outer_window = std::move(map->outer_window);
  }
  if (places) replaced.version.places = std::exchange(newest_.places, std::move(*places));
  if (loops) replaced.version.loops = std::exchange(newest_.loops, std::move(*loops));
  return replaced;
}

std::shared_ptr<const MapVersion> MapLender::newest() {
  Replaced replaced;  // outlives the lock
  const std::scoped_lock lock(borrowers_);
  replaced = take_newest();
  if (loan_) return loan_;
  loan_ = std::make_shared<const MapVersion>(newest_);
  std::erase_if(loans_, [](const auto& loan) { return loan.expired(); });
  loans_.push_back(loan_);
  return loan_;
}

void MapLender::catch_up() {
  Replaced replaced;  // outlives the lock
  const std::unique_lock lock(borrowers_, std::try_to_lock);
  if (lock) replaced = take_newest();
}

MapLender::Loans MapLender::held() {
  const std::scoped_lock lock(borrowers_);
  Loans loans;
  for (const auto& weak : loans_) {
    const auto loan = weak.lock();
    const long ours = loan == loan_ ? 2 : 1;
    if (!loan || loan.use_count() == ours) continue;
    ++loans.versions;
    const std::uint64_t version = loan->graph.version();
    if (loans.versions == 1 || version < loans.oldest) loans.oldest = version;
  }
  return loans;
}

}  // namespace twofold
