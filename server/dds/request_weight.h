#pragma once

#include <concepts>
#include <cstddef>
#include <string>

#include "idl/topics.h"

/// The size of a request for the schedule: its number of items, and its memory.
namespace trammel {

template <typename Request>
concept AsksForTargets = requires(const Request& request) {
  request.targets();
};
template <typename Request>
concept AsksForPoses = requires(const Request& request) {
  request.poses();
};
template <typename Request>
concept HasAction = requires(const Request& request) {
  request.action();
};
template <typename Request>
concept IsQuestion = requires(const Request& request) {
  request.what();
};

/// Items that are computed apart from each other.
template <typename Request>
[[nodiscard]] std::size_t items_of(const Request& request) {
  if constexpr (AsksForTargets<Request>) {
    return request.targets().size();
  } else if constexpr (AsksForPoses<Request>) {
    return request.poses().size();
  } else {
    return 1;
  }
}

/// The approximate memory of a request until it is answered, bytes.
template <typename Request>
[[nodiscard]] std::size_t bytes_of_request(const Request& request) {
  constexpr std::size_t kAskedAndAnswered = 1024;  // bytes per item, for question and answer
  std::size_t bytes = sizeof(Request) + kAskedAndAnswered * items_of(request);
  if constexpr (requires { request.bytes; }) bytes += request.bytes;  // serialized
  return bytes;
}

/// Bytes that a reply takes in memory, about.
template <typename Reply>
[[nodiscard]] std::size_t bytes_of_reply(const Reply& reply) {
  constexpr std::size_t kAnswered = 512;  // bytes per item, for the answer
  std::size_t bytes = sizeof(Reply) + reply.header().message().size();
  if constexpr (requires { reply.corrections(); }) bytes += kAnswered * reply.corrections().size();
  if constexpr (requires { reply.predictions(); }) bytes += kAnswered * reply.predictions().size();
  if constexpr (requires { reply.models(); }) bytes += kAnswered * reply.models().size();
  if constexpr (requires { reply.jobs(); })
    bytes += kAnswered * (reply.jobs().size() + reply.batches().size());
  if constexpr (requires { reply.text(); }) bytes += reply.text().size() + reply.page_html().size();
  return bytes;
}

/// The key of changes that run one after the other: the cell. Reading an imported model takes
/// seconds and changes nothing yet, so the cell does not wait for it. Imports run one at a time
/// because of their memory.
template <typename Request>
[[nodiscard]] std::string turn_of(const Request& request, const std::string& cell) {
  if constexpr (requires { request.model_text(); }) {
    if (request.action() == wire::MANAGE_IMPORT) return "/imports";  // no name of a cell
  }
  return cell;
}

/// The key of requests with similar costs: the cell, and the action.
template <typename Request>
[[nodiscard]] std::string work_of(const Request& request, const std::string& cell,
                                  const char* operation) {
  std::string work = cell + '/' + operation;
  if constexpr (HasAction<Request>)
    work += '/' + std::to_string(static_cast<int>(request.action()));
  if constexpr (IsQuestion<Request>) work += '/' + std::to_string(static_cast<int>(request.what()));
  if constexpr (requires { request.what(); })
    work += '/' + std::to_string(static_cast<int>(request.what()));
  return work;
}

}  // namespace trammel
