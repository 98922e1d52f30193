#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>

#include "server/base/mutex.h"

namespace trammel {

struct RoomLimits {
  std::size_t bytes = 256u << 20;        ///< of all requests that wait or are processed
  std::size_t client_bytes = 64u << 20;  ///< for those of one client
  double cell_share = 0.5;               ///< of `bytes`, for those of one cell
};

/// The memory that requests may take, shared by all lanes. Thread-safe.
class Room {
 public:
  explicit Room(const RoomLimits& limits) : limits_(limits) {}

  /// Some of the room, until it is destroyed.
  class Place {
   public:
    Place(Place&& other) noexcept;
    Place& operator=(Place&&) = delete;
    ~Place();

   private:
    friend class Room;
    Place(Room& room, std::string client, std::string cell, std::size_t bytes);
    Room* room_;
    std::string client_, cell_;
    std::size_t bytes_;
  };

  /// Empty if the room, the client's share or the cell's share is used up (requests without a cell
  /// have no such limit).
  [[nodiscard]] std::optional<Place> take(const std::string& client, const std::string& cell,
                                          std::size_t bytes);
  [[nodiscard]] std::size_t bytes() const;
  /// Sets the limits; requests already in the room stay.
  void set_limits(const RoomLimits& limits);

 private:
  void give_back(const Place& place);

  mutable Mutex mutex_;
  RoomLimits limits_ TRAMMEL_GUARDED_BY(mutex_);
  std::size_t bytes_ TRAMMEL_GUARDED_BY(mutex_) = 0;
  std::map<std::string, std::size_t> by_client_ TRAMMEL_GUARDED_BY(mutex_);
  std::map<std::string, std::size_t> by_cell_ TRAMMEL_GUARDED_BY(mutex_);
};

}  // namespace trammel
