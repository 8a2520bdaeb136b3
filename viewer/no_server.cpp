// In place of the server where Node.js or Boost was missing when the program was built.
#include <stdexcept>

#include "twofold/viewer.hpp"
#include "viewer/server.hpp"

namespace twofold {

class ViewServer::Impl {};

ViewServer::ViewServer(const ViewServerOptions&, const ViewScene&, const ViewTitle&) {
  throw std::runtime_error(
      "this program was built without the viewer; it needs nodejs, npm and libboost-dev (docs/viewer.md)");
}
ViewServer::~ViewServer() = default;

const std::string& ViewServer::address() const {
  static const std::string kNone;
  return kNone;
}
bool ViewServer::is_open_to_network() const {
  return false;
}
void ViewServer::run(const std::stop_token&, const Tick&, const std::function<std::string()>&) {}

bool has_viewer() {
  return false;
}

}  // namespace twofold
