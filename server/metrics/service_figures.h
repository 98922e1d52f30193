#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/metrics/latency_histogram.h"
#include "server/metrics/work_counts.h"

/// The figures of a service for those who watch it: plain values, read at one moment.
namespace trammel {

struct OperationFigures {
  std::string operation;
  LatencyHistogram::Counts latency;  ///< of processed requests
  std::map<std::string, std::uint64_t>
      by_result;  ///< answers, by the word of their result code: `ok`, `busy`
};

struct QueueFigures {
  std::string queue;
  std::size_t requests = 0;  ///< waiting or being processed
};

/// Counts are since the service started.
struct ServiceFigures {
  std::vector<OperationFigures> operations;
  std::vector<QueueFigures> queues;
  std::size_t waiting_bytes = 0;  ///< memory of the requests that wait or are worked on
  std::size_t clients = 0;        ///< with a reply channel
  std::uint64_t unheard = 0;      ///< replies that were dropped because nobody listened
  std::uint64_t strangers = 0;    ///< handshakes of participants without the right certificate
  std::uint64_t misdirected = 0;  ///< requests whose reply would have gone to another client
  std::uint64_t unreadable = 0;   ///< requests whose header could not be read
  std::uint64_t lost = 0;         ///< requests that DDS lost before the service saw them
  std::map<std::string, std::uint64_t> dropped_packets;  ///< by reason
  std::map<std::string, WorkFigures> work;               ///< by cell
  std::optional<std::uint64_t> not_recorded = {};  ///< requests missing from the record; empty:
                                                   ///< recording is off
};

/// Whether the threads of a service do their work.
struct Movement {
  bool watched = false;            ///< the service runs
  std::vector<std::string> still;  ///< parts that have not moved for longer than they ever need
};

}  // namespace trammel
