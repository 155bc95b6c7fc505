// Fits B and D of both axles to a log: columns steer_rad, fx_n, vx_mps, vy_mps, yaw_rate_radps,
// ax_mps2, ay_mps2 at 50 Hz, after one line of names; an empty cell or nan is a missing measurement.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>

#include "sysid/identify/prediction_error.hpp"

constexpr std::size_t kInputs = 2;
using Row = std::array<double, kInputs + sysid::kChannels>;

/// Cells of a line of the file; `number` is that of the line.
Row read_row(const std::string& line, int number) {
    const auto refuse = [&](const std::string& why) {
        throw std::invalid_argument("line " + std::to_string(number) + ": " + why);
    };
    Row row{};
    const auto found = static_cast<std::size_t>(std::count(line.begin(), line.end(), ',')) + 1;
    if (found != row.size())
        refuse(std::to_string(found) + " cells in place of " + std::to_string(row.size()));
    std::stringstream cells(line);
    for (std::size_t i = 0; i < row.size(); ++i) {
        std::string cell;
        std::getline(cells, cell, ',');
        const std::size_t end = cell.find_last_not_of(" \r");
        row[i] = std::numeric_limits<double>::quiet_NaN();
        if (end != std::string::npos) {
            std::size_t read = 0;
            try {
                row[i] = std::stod(cell, &read);
            } catch (const std::exception&) {
            }
            if (read != end + 1) refuse("'" + cell + "' is no number");
        }
        if (i < kInputs && !std::isfinite(row[i])) refuse("no steering angle or wheel force");
    }
    return row;
}

int main(int argc, char** argv) try {
    sysid::Problem problem;
    problem.model.car = {1250.0, 1.25, 1.35, 0.5, 1.52, 1.5, 0.65, 1.225, 0.65};
    sysid::Run run;
    run.dt = 0.02;
    const std::string path = argc > 1 ? argv[1] : "slalom.csv";
    std::ifstream file(path);
    if (!file) throw std::invalid_argument(path + " cannot be opened");
    std::string line;
    std::getline(file, line);
    for (int number = 2; std::getline(file, line); ++number) {
        if (line.find_first_not_of(" \r") == std::string::npos) continue;
        const Row row = read_row(line, number);
        run.inputs.push_back({row[0], row[1], run.dt * static_cast<double>(run.size())});
        run.measurements.emplace_back(
            Eigen::Map<const sysid::Vec<sysid::kChannels>>(row.data() + kInputs));
    }
    if (run.size() < 2) throw std::invalid_argument("the log has fewer than two samples");
    problem.runs.push_back(run);

    std::vector<double> p(sysid::kParameterCount, 0.0);
    for (std::size_t i = 0; i < sysid::kBaseParameterCount; ++i)
        p[i] = sysid::kBaseParameterInfos[i].typical;
    p[sysid::kYawInertia] = 1750.0;
    const sysid::Noise noise{{0.05, 0.02, 0.005, 0.1, 0.1}, {0.05, 0.05, 0.02}, {50, 100, 100}};
    const std::vector<int> columns{sysid::kBFront, sysid::kDFront, sysid::kBRear, sysid::kDRear};
    sysid::Mat<4, 4> information;
    sysid::Vec<4> gradient;
    for (int i = 0; i < 10; ++i) {  // Gauss-Newton; the filter is linearised anew each time
        const auto filter = sysid::freeze(problem, p.data(), noise);
        sysid::normal_equations(problem, p.data(), filter, columns, gradient.data(),
                                information.data());
        // Of parameters by their own sizes: what no corner showed has no cornering stiffness.
        const sysid::Vec<4> size(p[columns[0]], p[columns[1]], p[columns[2]], p[columns[3]]);
        const sysid::Mat<4, 4> share = size.asDiagonal() * information * size.asDiagonal();
        const Eigen::SelfAdjointEigenSolver<sysid::Mat<4, 4>> told(share);
        if (!(told.eigenvalues()[0] > 4.0))
            throw std::invalid_argument("this driving does not tell B and D of both axles to within "
                                        "half of their values: drive corners near the limit");
        const sysid::Vec<4> step = information.ldlt().solve(gradient);
        for (int j = 0; j < 4; ++j) p[static_cast<std::size_t>(columns[j])] += step[j];
    }
    // Cornering stiffness of an axle, B C D F_z, and its standard deviation.
    const sysid::Mat<4, 4> covariance = information.inverse();
    for (int axle = 0; axle < 2; ++axle) {
        const double* t = p.data() + 4 * axle;
        const auto& car = problem.model.car;
        const double lever = axle == 0 ? car.lr_m : car.lf_m;
        const double load = car.mass_kg * car.gravity_mps2 * lever / (car.lf_m + car.lr_m);
        const double stiffness = t[0] * t[1] * t[2] * load;
        const sysid::Vec<2> slope(stiffness / t[0], stiffness / t[2]);
        const double spread = slope.dot(covariance.block<2, 2>(2 * axle, 2 * axle) * slope);
        std::printf("%-5s %.1f +- %.1f kN/rad\n", axle == 0 ? "front" : "rear", stiffness / 1e3,
                    std::sqrt(spread) / 1e3);
    }
} catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 1;
}
