// Fits B and D of both axles to a log: columns steer_rad, fx_n, vx_mps, vy_mps, yaw_rate_radps,
// ax_mps2, ay_mps2 at 50 Hz, after one line of names; an empty or missing value is nan.
#include <cstdio>
#include <fstream>
#include <iostream>
#include <stdexcept>

#include "sysid/identify/prediction_error.hpp"

int main(int argc, char** argv) try {
    sysid::Problem problem;
    problem.model.car = {1250.0, 1.25, 1.35, 0.5, 1.52, 1.5, 0.65, 1.225, 0.65};
    sysid::Run run;
    run.dt = 0.02;
    std::ifstream file(argc > 1 ? argv[1] : "slalom.csv");
    std::string line;
    for (std::getline(file, line); std::getline(file, line);) {
        std::array<double, 2 + sysid::kChannels> row{};
        std::size_t begin = 0;
        for (double& value : row) {
            value = std::stod(line.substr(begin));
            begin = line.find(',', begin) + 1;
        }
        run.inputs.push_back({row[0], row[1], run.dt * static_cast<double>(run.size())});
        run.measurements.emplace_back(Eigen::Map<sysid::Vec<sysid::kChannels>>(row.data() + 2));
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
