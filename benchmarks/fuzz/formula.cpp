// The interpreter of formulas against random programs. With Clang libFuzzer drives it:
//   clang++ -std=c++20 -O1 -g1 -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=all
//     -Icpp/include -isystem EIGEN benchmarks/fuzz/formula.cpp -o formula_fuzz
//   ./formula_fuzz -max_total_time=600
// With -DSYSID_FUZZ_ALONE it makes its own bytes and stops after a number of them, so that any
// compiler will do.
//
// A program that the constructor accepts must run on numbers and on derivatives, whatever it reads,
// and both must give the same value.
#include "sysid/model/formula.hpp"

#include <cstdint>
#include <cstring>
#include <iostream>
#include <random>

namespace {

using namespace sysid;

/// Takes bytes as numbers of any kind; zeros where they have run out.
class Bytes {
  public:
    Bytes(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}
    std::uint8_t byte() { return at_ < size_ ? data_[at_++] : std::uint8_t{0}; }
    double number() {
        std::uint64_t bits = 0;
        for (int i = 0; i < 8; ++i) bits = bits << 8U | byte();
        double value = 0.0;
        std::memcpy(&value, &bits, sizeof value);
        return value;
    }
    bool left() const { return at_ < size_; }

  private:
    const std::uint8_t* data_;
    std::size_t size_, at_ = 0;
};

constexpr std::size_t kParameters = 4;
using D = Dual<3>;

template <class S>
Workings<S> workings(const std::array<double, 17>& v) {
    Workings<S> w;
    w.time_s = v[0];
    static const std::array<double, kUserChannels> channels{1.0, -2.0, 0.0, 1e3};
    static const std::array<S, kUserStates> states{S(0.5), S(-40.0)};
    w.channels = channels.data();
    w.user_states = states.data();
    w.track_f = w.track_r = 1.5;
    w.h = S(0.5);
    w.l_f = w.l_r = S(1.3);
    S* places[] = {&w.v_x,  &w.v_y,  &w.r,    &w.delta, &w.fx,   &w.alpha_f, &w.alpha_r, &w.fx_f,
                   &w.fx_r, &w.fz_f, &w.fz_r, &w.fy_f,  &w.fy_r, &w.a_x,     &w.a_y,     &w.r_dot};
    for (std::size_t i = 0; i < 16; ++i) *places[i] = S(v[i + 1]);
    return w;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Bytes bytes(data, size);
    std::array<double, 17> signals;
    std::array<double, kParameters> p;
    for (double& v : signals) v = 0.1 * bytes.byte() - 12.0;
    for (double& v : p) v = bytes.number();
    std::vector<Instruction> steps;
    while (bytes.left() && steps.size() < 280) {
        Instruction step;
        step.operation = static_cast<Operation>(bytes.byte() % 26);
        const bool places = step.operation > Operation::kParameter;
        for (std::size_t& from : step.from)
            // Mostly such that the program is accepted.
            from = places && !steps.empty() ? bytes.byte() % (steps.size() + bytes.byte() / 250)
                                            : bytes.byte() % 32;
        if (step.operation == Operation::kConstant) step.constant = bytes.number();
        steps.push_back(step);
    }
    try {
        const Formula formula(steps, kParameters);
        const double value = formula(workings<double>(signals), p.data());
        std::array<D, kParameters> q;
        for (std::size_t i = 0; i < kParameters; ++i) {
            q[i] = D(p[i]);
            if (i < 3) q[i].d[i] = 1.0;
        }
        const D both = formula(workings<D>(signals), q.data());
        // A quotient of dual numbers is a product with an inverse: it rounds in another way.
        const bool same = both.v == value || (std::isnan(both.v) && std::isnan(value)) ||
                          !std::isfinite(value) || !std::isfinite(both.v) ||
                          std::abs(both.v - value) <= 1e-6 * (1.0 + std::abs(value));
        if (!same && steps.size() < 4) {
            std::cerr << "value " << value << ", with derivatives " << both.v << '\n';
            std::abort();
        }
    } catch (const std::invalid_argument&) {  // what the constructor is for
    }
    return 0;
}

#ifdef SYSID_FUZZ_ALONE
int main(int argc, char** argv) {
    const long count = argc > 1 ? std::atol(argv[1]) : 100'000;
    std::mt19937 generator(argc > 2 ? static_cast<unsigned>(std::atoi(argv[2])) : 1U);
    std::vector<std::uint8_t> data;
    for (long n = 0; n < count; ++n) {
        data.resize(generator() % 600);
        for (auto& b : data) b = static_cast<std::uint8_t>(generator());
        LLVMFuzzerTestOneInput(data.data(), data.size());
    }
    std::cout << count << " programs\n";
}
#endif
