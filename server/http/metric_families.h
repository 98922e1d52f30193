#pragma once

#include <prometheus/metric_family.h>

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace trammel {

using MetricLabels = std::vector<std::pair<const char*, std::string>>;

/// Collects metrics in the order in which they are added.
class MetricFamilies {
 public:
  void gauge(const char* name, const char* help, double value, const MetricLabels& labels = {});
  void counter(const char* name, const char* help, double value, const MetricLabels& labels = {});
  /// `in_class`: the count of each class; `bounds`: their upper bounds. One more class has the
  /// values above the last bound.
  void histogram(const char* name, const char* help, std::span<const double> bounds,
                 std::span<const std::uint64_t> in_class, double sum,
                 const MetricLabels& labels = {});

  /// In Prometheus' text format.
  [[nodiscard]] std::string text() const;

 private:
  prometheus::ClientMetric& add(const char* name, const char* help, prometheus::MetricType type,
                                const MetricLabels& labels);

  std::vector<prometheus::MetricFamily> families_;
  std::map<std::string, std::size_t, std::less<>> at_;  // by name
};

}  // namespace trammel
