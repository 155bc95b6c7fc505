// A closed track, and the driver who looks ahead on it.
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

namespace sysid::lab {

struct Track {
    std::vector<std::array<double, 2>> points;  // [m], in the direction of driving, closed
    double look_ahead_m = 15.0;
    double look_ahead_s = 0.4;  // times the wanted speed
};

/// Steers towards the first point of the track that is at least the look-ahead distance away.
class TrackDriver {
  public:
    struct Sight {
        double heading_rad;      // of the line to that point
        double left_of_track_m;  // how far the car is to the left of the nearest point
    };

    explicit TrackDriver(Track track) : track_(std::move(track)) {}

    Sight look(double x, double y, double heading_rad, double speed_mps) {
        const std::size_t n = track_.points.size();
        find_nearest(x, y);
        const double distance = track_.look_ahead_m + track_.look_ahead_s * speed_mps;
        std::size_t target = nearest_;
        for (std::size_t step = 0; step < n && away(target, x, y) < distance; ++step)
            target = (target + 1) % n;
        const auto [tx, ty] = track_.points[target];
        const auto [nx, ny] = track_.points[nearest_];
        const double beside = (nx - x) * std::sin(heading_rad) - (ny - y) * std::cos(heading_rad);
        return {std::atan2(ty - y, tx - x), beside};
    }

  private:
    double away(std::size_t i, double x, double y) const {
        return std::hypot(track_.points[i][0] - x, track_.points[i][1] - y);
    }

    // From the last nearest point onwards, so that where a track comes near itself the car stays
    // on its own piece; all of it at first.
    void find_nearest(double x, double y) {
        const std::size_t n = track_.points.size();
        const std::size_t window = first_ ? n : std::min<std::size_t>(n, kWindow);
        const std::size_t start = first_ ? 0 : (nearest_ + n - window / 4) % n;
        double least = std::numeric_limits<double>::infinity();
        for (std::size_t step = 0; step < window; ++step) {
            const std::size_t i = (start + step) % n;
            const double distance = away(i, x, y);
            if (distance < least) {
                least = distance;
                nearest_ = i;
            }
        }
        first_ = false;
    }

    static constexpr std::size_t kWindow = 64;

    Track track_;
    std::size_t nearest_ = 0;
    bool first_ = true;
};

}  // namespace sysid::lab
