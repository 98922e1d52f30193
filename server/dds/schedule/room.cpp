#include "server/dds/schedule/room.h"

#include <utility>

namespace trammel {
namespace {

std::size_t used(const std::map<std::string, std::size_t>& by_name, const std::string& name) {
  const auto found = by_name.find(name);
  return found == by_name.end() ? 0 : found->second;
}

void take_off(std::map<std::string, std::size_t>& by_name, const std::string& name,
              std::size_t bytes) {
  const auto found = by_name.find(name);
  found->second -= bytes;
  if (found->second == 0) by_name.erase(found);
}

}  // namespace

Room::Place::Place(Room& room, std::string client, std::string cell, std::size_t bytes)
    : room_(&room), client_(std::move(client)), cell_(std::move(cell)), bytes_(bytes) {}

Room::Place::Place(Place&& other) noexcept
    : room_(std::exchange(other.room_, nullptr)),
      client_(std::move(other.client_)),
      cell_(std::move(other.cell_)),
      bytes_(other.bytes_) {}

Room::Place::~Place() {
  if (room_ != nullptr) room_->give_back(*this);
}

std::optional<Room::Place> Room::take(const std::string& client, const std::string& cell,
                                      std::size_t bytes) {
  const std::size_t some = bytes + 1;  // an entry of size zero must differ from no entry
  const MutexLock lock(mutex_);
  const auto cell_limit =
      static_cast<std::size_t>(limits_.cell_share * static_cast<double>(limits_.bytes));
  if (bytes_ + some > limits_.bytes || used(by_client_, client) + some > limits_.client_bytes)
    return std::nullopt;
  if (!cell.empty() && used(by_cell_, cell) + some > cell_limit) return std::nullopt;
  bytes_ += some;
  by_client_[client] += some;
  by_cell_[cell] += some;
  return Place(*this, client, cell, some);
}

void Room::give_back(const Place& place) {
  const MutexLock lock(mutex_);
  bytes_ -= place.bytes_;
  take_off(by_client_, place.client_, place.bytes_);
  take_off(by_cell_, place.cell_, place.bytes_);
}

void Room::set_limits(const RoomLimits& limits) {
  const MutexLock lock(mutex_);
  limits_ = limits;
}

std::size_t Room::bytes() const {
  const MutexLock lock(mutex_);
  return bytes_;
}

}  // namespace trammel
