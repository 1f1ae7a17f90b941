// deflate.cpp: deflate (RFC 1951) and zlib's envelope (RFC 1950), both ways. The names are the RFCs', and what stands
// there is not explained again here.
#include "deflate.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace {

using Bytes = std::vector<std::uint8_t>;
using Fail = std::function<void(std::size_t at, const std::string& what)>;  // throws
using Counts = std::vector<int>;   // how often each symbol occurs
using Lengths = std::vector<int>;  // of each symbol's code in bits, 0 where it has none

constexpr std::size_t end_of_block = 256, literal_codes = 286, distance_codes = 30, length_code_codes = 19;
constexpr int longest_code = 15, longest_length_code = 7;  // bits
constexpr std::size_t shortest_match = 3, longest_match = 258, farthest_match = 32768;

// The length symbols from 257 on and the distance symbols: the first value of each and the number of bits added to it.
constexpr std::size_t length_base[] = {3,  4,  5,  6,  7,  8,  9,  10, 11,  13,  15,  17,  19,  23, 27,
                                       31, 35, 43, 51, 59, 67, 83, 99, 115, 131, 163, 195, 227, 258};
constexpr int length_bits[] = {0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3, 4, 4, 4, 4, 5, 5, 5, 5, 0};
constexpr std::size_t distance_base[] = {1,   2,   3,   4,   5,   7,    9,    13,   17,   25,
                                         33,  49,  65,  97,  129, 193,  257,  385,  513,  769,
                                         1025, 1537, 2049, 3073, 4097, 6145, 8193, 12289, 16385, 24577};
constexpr int distance_bits[] = {0, 0, 0, 0, 1, 1, 2, 2,  3,  3,  4,  4,  5,  5,  6,
                                 6, 7, 7, 8, 8, 9, 9, 10, 10, 11, 11, 12, 12, 13, 13};
constexpr std::size_t length_code_order[] = {16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15};

// The codes of blocks that do not bring their own; the last two of each stand for nothing, but have a code.
Lengths fixed_literals() {
    Lengths lengths(literal_codes + 2, 8);
    std::fill(lengths.begin() + 144, lengths.begin() + 256, 9);
    std::fill(lengths.begin() + 256, lengths.begin() + 280, 7);
    return lengths;
}
Lengths fixed_distances() { return Lengths(distance_codes + 2, 5); }

// The canonical codes of the lengths, each reversed: a code's first bit goes first, into the lowest free bit of a byte.
std::vector<std::size_t> reversed_codes(const Lengths& lengths) {
    std::vector<std::size_t> codes(lengths.size());
    std::size_t next = 0;
    for (int length = 1; length <= longest_code; length++, next <<= 1)
        for (std::size_t symbol = 0; symbol < lengths.size(); symbol++) {
            if (lengths[symbol] != length) continue;
            for (int i = 0; i < length; i++) codes[symbol] |= (next >> i & 1) << (length - 1 - i);
            next++;
        }
    return codes;
}

std::uint32_t adler32(const Bytes& bytes) {
    std::uint32_t a = 1, b = 0;
    for (const std::uint8_t byte : bytes) {
        a = (a + byte) % 65521;
        b = (b + a) % 65521;
    }
    return b << 16 | a;
}

// ---- reading ----

class BitReader {
public:
    BitReader(const Bytes& bytes, std::size_t begin, const Fail& fail)
        : bytes_(bytes), next_(begin), fail_(fail) {}

    // The next n bits, at most 16 and the first of them lowest; zeros after the last byte.
    std::size_t peek(int n) {
        for (; count_ < n && next_ < bytes_.size(); count_ += 8) bits_ |= std::size_t{bytes_[next_++]} << count_;
        return bits_ & ((std::size_t{1} << n) - 1);
    }
    std::size_t take(int n) {
        const std::size_t value = peek(n);
        if (count_ < n) fail("the compressed data is truncated");
        bits_ >>= n;
        count_ -= n;
        return value;
    }
    void to_byte() { take(count_ % 8); }
    std::size_t position() const { return next_ - static_cast<std::size_t>(count_ / 8); }
    void fail(const std::string& what) const { fail_(position(), what); }

private:
    const Bytes& bytes_;
    std::size_t next_;
    const Fail& fail_;
    std::size_t bits_ = 0;  // what was taken from the bytes and not used yet
    int count_ = 0;         // how many bits that is
};

// Finds a symbol by the 15 bits that begin with its code.
class Decoder {
public:
    Decoder(const Lengths& lengths, const BitReader& in) : table_(1 << longest_code) {
        std::size_t used = 0;  // of the table
        for (const int length : lengths)
            if (length > 0) used += std::size_t{1} << (longest_code - length);
        if (used > table_.size()) in.fail("more codes than there can be");
        const std::vector<std::size_t> codes = reversed_codes(lengths);
        for (std::size_t symbol = 0; symbol < lengths.size(); symbol++)
            if (lengths[symbol] > 0)
                for (std::size_t i = codes[symbol]; i < table_.size(); i += std::size_t{1} << lengths[symbol])
                    table_[i] = {static_cast<std::uint16_t>(symbol), static_cast<std::uint16_t>(lengths[symbol])};
    }
    std::size_t next(BitReader& in) const {
        const Entry& entry = table_[in.peek(longest_code)];
        if (entry.length == 0) in.fail("a code that stands for nothing");
        in.take(entry.length);
        return entry.symbol;
    }

private:
    struct Entry {
        std::uint16_t symbol = 0, length = 0;
    };
    std::vector<Entry> table_;
};

void read_dynamic_lengths(BitReader& in, Lengths& literals, Lengths& distances) {
    const std::size_t n_literals = in.take(5) + 257, n_distances = in.take(5) + 1, n_codes = in.take(4) + 4;
    if (n_literals > literal_codes || n_distances > distance_codes) in.fail("more codes than there are symbols");
    Lengths code_lengths(length_code_codes);
    for (std::size_t i = 0; i < n_codes; i++) code_lengths[length_code_order[i]] = static_cast<int>(in.take(3));
    const Decoder decoder(code_lengths, in);
    Lengths all;
    while (all.size() < n_literals + n_distances) {
        const std::size_t symbol = decoder.next(in);
        if (symbol < 16) {
            all.push_back(static_cast<int>(symbol));
        } else if (symbol == 16) {
            if (all.empty()) in.fail("the first code length repeats the one before it");
            all.insert(all.end(), 3 + in.take(2), int{all.back()});
        } else {
            all.insert(all.end(), symbol == 17 ? 3 + in.take(3) : 11 + in.take(7), 0);
        }
    }
    if (all.size() > n_literals + n_distances) in.fail("more code lengths than there are codes");
    const auto middle = all.begin() + static_cast<std::ptrdiff_t>(n_literals);
    literals.assign(all.begin(), middle);
    distances.assign(middle, all.end());
}

// Appends a block's bytes to OUT, which may have SIZE of them in all.
void inflate_block(BitReader& in, const Decoder& literals, const Decoder& distances, Bytes& out, std::size_t size) {
    for (;;) {
        const std::size_t symbol = literals.next(in);
        if (symbol == end_of_block) return;
        if (symbol < end_of_block) {
            if (out.size() == size) in.fail("more bytes than expected");
            out.push_back(static_cast<std::uint8_t>(symbol));
            continue;
        }
        if (symbol >= literal_codes) in.fail("a length that does not exist");
        const std::size_t l = symbol - end_of_block - 1, length = length_base[l] + in.take(length_bits[l]);
        const std::size_t d = distances.next(in);
        if (d >= distance_codes) in.fail("a distance that does not exist");
        const std::size_t distance = distance_base[d] + in.take(distance_bits[d]);
        if (distance > out.size()) in.fail("a distance to before the first byte");
        if (length > size - out.size()) in.fail("more bytes than expected");
        for (std::size_t i = 0; i < length; i++) out.push_back(std::uint8_t{out[out.size() - distance]});
    }
}

void inflate_stored(BitReader& in, Bytes& out, std::size_t size) {
    in.to_byte();
    const std::size_t length = in.take(16), complement = in.take(16);
    if ((length ^ complement) != 0xFFFF) in.fail("a stored block whose length and its complement disagree");
    if (length > size - out.size()) in.fail("more bytes than expected");
    for (std::size_t i = 0; i < length; i++) out.push_back(static_cast<std::uint8_t>(in.take(8)));
}

// ---- writing ----

class BitWriter {
public:
    explicit BitWriter(Bytes& out) : out_(out) {}
    void put(std::size_t value, int n) {
        bits_ |= value << count_;
        for (count_ += n; count_ >= 8; count_ -= 8, bits_ >>= 8) out_.push_back(static_cast<std::uint8_t>(bits_));
    }
    void to_byte() { put(0, (8 - count_) % 8); }

private:
    Bytes& out_;
    std::size_t bits_ = 0;
    int count_ = 0;
};

struct Token {
    std::uint8_t literal = 0;              // where length is 0
    std::size_t length = 0, distance = 0;  // of a match
};

// The newest place where the same three bytes stood, and from each place the one before: hash chains.
class Matches {
public:
    explicit Matches(const Bytes& data) : data_(data), newest_(1 << hash_bits, none), older_(data.size(), none) {}

    void insert(std::size_t at) {
        if (data_.size() - at < shortest_match) return;
        older_[at] = std::exchange(newest_[hash(at)], at);
    }

    // The longest match of what begins at AT with something before it, and the nearest one of that length.
    Token longest(std::size_t at) const {
        Token best;
        if (data_.size() - at < shortest_match) return best;
        const std::size_t most = std::min(longest_match, data_.size() - at);
        std::size_t there = newest_[hash(at)];
        for (int tries = most_tries; tries > 0 && there != none && at - there <= farthest_match; tries--) {
            std::size_t length = 0;
            if (data_[there + best.length] == data_[at + best.length])  // else it cannot be longer
                while (length < most && data_[there + length] == data_[at + length]) length++;
            // Three bytes from far away cost more than three literals.
            const bool pays = length > shortest_match || (length == shortest_match && at - there <= 4096);
            if (pays && length > best.length) best = {0, length, at - there};
            if (best.length == most) break;
            there = older_[there];
        }
        return best;
    }

private:
    static constexpr int most_tries = 256, hash_bits = 15;
    static constexpr std::size_t none = static_cast<std::size_t>(-1);

    std::size_t hash(std::size_t at) const {
        const std::uint32_t a = data_[at], b = data_[at + 1], c = data_[at + 2];
        return (a << 16 | b << 8 | c) * 0x9E3779B1u >> (32 - hash_bits);  // 2^32 over the golden ratio
    }
    const Bytes& data_;
    std::vector<std::size_t> newest_, older_;
};

// LZ77 with one step of foresight: a match waits until it is known that none which begins at the next byte is longer.
std::vector<Token> tokenize(const Bytes& data) {
    std::vector<Token> tokens;
    Matches matches(data);
    Token waiting;  // a match from one byte earlier, or of length 0
    for (std::size_t at = 0; at < data.size();) {
        const Token match = waiting.length == longest_match ? Token{} : matches.longest(at);
        if (waiting.length > 0 && match.length <= waiting.length) {
            tokens.push_back(waiting);
            for (std::size_t i = 1; i < waiting.length; i++) matches.insert(at++);
            waiting = {};
            continue;
        }
        if (waiting.length > 0) tokens.push_back({data[at - 1], 0, 0});
        if (match.length == 0) tokens.push_back({data[at], 0, 0});
        waiting = match;
        matches.insert(at++);
    }
    return tokens;  // nothing waits now: a match that began at the last byte would be too short
}

// The lengths of an optimal prefix code of at most LIMIT bits by the package-merge algorithm (Larmore and Hirschberg
// 1990): a symbol of n is a coin in each denomination from 2^-1 to 2^-limit, two coins make a pair of the next larger
// one, and a symbol's code is as long as it is often among the 2n - 2 cheapest coins and pairs of denomination 2^-1.
Lengths optimal_lengths(Counts counts, int limit) {
    // A code of fewer than two symbols leaves bits without meaning, which some decoders refuse.
    const auto occurs = [](int n) { return n > 0; };
    for (auto n = counts.begin(); std::count_if(counts.begin(), counts.end(), occurs) < 2; n++) *n = std::max(*n, 1);

    struct Coin {
        int cost;
        std::vector<std::size_t> symbols;
    };
    const auto pair_of = [](const Coin& a, const Coin& b) {
        Coin pair{a.cost + b.cost, a.symbols};
        pair.symbols.insert(pair.symbols.end(), b.symbols.begin(), b.symbols.end());
        return pair;
    };
    const auto cheaper = [](const Coin& a, const Coin& b) { return a.cost < b.cost; };
    std::vector<Coin> single;
    for (std::size_t i = 0; i < counts.size(); i++)
        if (counts[i] > 0) single.push_back({counts[i], {i}});
    std::stable_sort(single.begin(), single.end(), cheaper);
    std::vector<Coin> coins = single;
    for (int denomination = limit; denomination > 1; denomination--) {
        std::vector<Coin> pairs;
        for (std::size_t i = 0; i + 1 < coins.size(); i += 2) pairs.push_back(pair_of(coins[i], coins[i + 1]));
        coins.clear();
        std::merge(single.begin(), single.end(), pairs.begin(), pairs.end(), std::back_inserter(coins), cheaper);
    }
    Lengths lengths(counts.size());
    for (std::size_t i = 0; i < 2 * single.size() - 2; i++)
        for (const std::size_t symbol : coins[i].symbols) lengths[symbol]++;
    return lengths;
}

// A symbol of the code that lengths are sent in: 0 to 15 are lengths, 16 to 18 repeat one, and EXTRA says how often.
struct LengthSymbol {
    std::size_t symbol, extra = 0;
    int extra_bits = 0;
};

std::vector<LengthSymbol> packed(const Lengths& lengths) {
    std::vector<LengthSymbol> out;
    for (auto at = lengths.begin(); at < lengths.end();) {
        const int length = *at;
        const auto end = std::find_if(at, lengths.end(), [length](int other) { return other != length; });
        std::size_t left = static_cast<std::size_t>(end - at);
        if (length > 0) {
            out.push_back({static_cast<std::size_t>(length)});
            left--;
        }
        while (left > 0) {
            const std::size_t n = std::min<std::size_t>(left, length > 0 ? 6 : 138);
            if (n < 3) out.insert(out.end(), n, {static_cast<std::size_t>(length)});
            else if (length > 0) out.push_back({16, n - 3, 2});
            else if (n < 11) out.push_back({17, n - 3, 3});
            else out.push_back({18, n - 11, 7});
            left -= n;
        }
        at = end;
    }
    return out;
}

// The symbol of a value, counted from the first of its table.
template <std::size_t n>
std::size_t symbol_of(const std::size_t (&base)[n], std::size_t value) {
    return static_cast<std::size_t>(std::upper_bound(base, base + n, value) - base) - 1;
}

void put_tokens(BitWriter& out, const Token* begin, const Token* end, const Lengths& literals,
                const Lengths& distances) {
    const std::vector<std::size_t> literal_code = reversed_codes(literals), distance_code = reversed_codes(distances);
    for (; begin < end; begin++) {
        if (begin->length == 0) {
            out.put(literal_code[begin->literal], literals[begin->literal]);
            continue;
        }
        const std::size_t l = symbol_of(length_base, begin->length), d = symbol_of(distance_base, begin->distance);
        out.put(literal_code[end_of_block + 1 + l], literals[end_of_block + 1 + l]);
        out.put(begin->length - length_base[l], length_bits[l]);
        out.put(distance_code[d], distances[d]);
        out.put(begin->distance - distance_base[d], distance_bits[d]);
    }
    out.put(literal_code[end_of_block], literals[end_of_block]);
}

// Writes the tokens as a block of codes made for them, or of the fixed codes where that takes no more bits.
void put_block(BitWriter& out, const Token* begin, const Token* end, bool last) {
    Counts literal_counts(literal_codes), distance_counts(distance_codes), length_counts(length_code_codes);
    literal_counts[end_of_block] = 1;
    for (const Token* token = begin; token < end; token++) {
        if (token->length == 0) {
            literal_counts[token->literal]++;
        } else {
            literal_counts[end_of_block + 1 + symbol_of(length_base, token->length)]++;
            distance_counts[symbol_of(distance_base, token->distance)]++;
        }
    }
    const auto without_zeros_at_the_end = [](Lengths lengths, std::size_t least) {
        while (lengths.size() > least && lengths.back() == 0) lengths.pop_back();
        return lengths;
    };
    const Lengths literals = without_zeros_at_the_end(optimal_lengths(literal_counts, longest_code), 257);
    const Lengths distances = without_zeros_at_the_end(optimal_lengths(distance_counts, longest_code), 1);
    Lengths both = literals;
    both.insert(both.end(), distances.begin(), distances.end());
    const std::vector<LengthSymbol> length_symbols = packed(both);
    for (const LengthSymbol& s : length_symbols) length_counts[s.symbol]++;
    const Lengths lengths = optimal_lengths(length_counts, longest_length_code);
    Lengths ordered;
    for (const std::size_t symbol : length_code_order) ordered.push_back(lengths[symbol]);
    ordered = without_zeros_at_the_end(ordered, 4);

    // The bits that depend on the choice; what is added to lengths and distances does not.
    const auto bits = [](const Counts& counts, const Lengths& code) {
        int sum = 0;
        for (std::size_t i = 0; i < std::min(counts.size(), code.size()); i++) sum += counts[i] * code[i];
        return sum;
    };
    int dynamic = 14 + 3 * static_cast<int>(ordered.size()) + bits(length_counts, lengths) +
                  bits(literal_counts, literals) + bits(distance_counts, distances);
    for (const LengthSymbol& s : length_symbols) dynamic += s.extra_bits;
    const bool fixed = bits(literal_counts, fixed_literals()) + bits(distance_counts, fixed_distances()) <= dynamic;

    out.put(last, 1);
    out.put(fixed ? 1 : 2, 2);
    if (fixed) {
        put_tokens(out, begin, end, fixed_literals(), fixed_distances());
        return;
    }
    out.put(literals.size() - 257, 5);
    out.put(distances.size() - 1, 5);
    out.put(ordered.size() - 4, 4);
    for (const int length : ordered) out.put(static_cast<std::size_t>(length), 3);
    const std::vector<std::size_t> length_code = reversed_codes(lengths);
    for (const LengthSymbol& s : length_symbols) {
        out.put(length_code[s.symbol], lengths[s.symbol]);
        out.put(s.extra, s.extra_bits);
    }
    put_tokens(out, begin, end, literals, distances);
}

}  // namespace

Bytes deflate(const Bytes& data) {
    constexpr std::size_t tokens_in_block = 32768;
    const std::vector<Token> tokens = tokenize(data);
    Bytes stream{0x78, 0xDA};  // deflate with a window of 32 KiB, by the slowest algorithm
    BitWriter out(stream);
    const Token* const end = tokens.data() + tokens.size();
    const Token* begin = tokens.data();
    do {
        const Token* const next = begin + std::min<std::ptrdiff_t>(end - begin, tokens_in_block);
        put_block(out, begin, next, next == end);
        begin = next;
    } while (begin < end);
    out.to_byte();
    for (int shift = 24; shift >= 0; shift -= 8) stream.push_back(static_cast<std::uint8_t>(adler32(data) >> shift));
    return stream;
}

Bytes inflate(const Bytes& stream, std::size_t size, const Fail& fail) {
    if (stream.size() < 6) fail(stream.size(), "the compressed data is truncated");
    const bool deflated = (stream[0] & 15) == 8, preset_dictionary = stream[1] & 32;
    if (!deflated || preset_dictionary || (stream[0] * 256 + stream[1]) % 31 != 0) fail(0, "this is no zlib stream");
    // The most that deflate can do is 258 bytes from two bits, the codes of a length and of a distance.
    if (size / (longest_match * 4) > stream.size()) fail(stream.size(), "the compressed data is truncated");
    Bytes out;
    out.reserve(size);
    BitReader in(stream, 2, fail);
    for (bool last = false; !last;) {
        last = in.take(1);
        const std::size_t type = in.take(2);
        if (type == 0) {
            inflate_stored(in, out, size);
        } else if (type == 1) {
            inflate_block(in, Decoder(fixed_literals(), in), Decoder(fixed_distances(), in), out, size);
        } else if (type == 2) {
            Lengths literals, distances;
            read_dynamic_lengths(in, literals, distances);
            inflate_block(in, Decoder(literals, in), Decoder(distances, in), out, size);
        } else {
            in.fail("a block of type 3");
        }
    }
    if (out.size() < size) in.fail("fewer bytes than expected");
    in.to_byte();
    std::size_t adler = 0;
    for (int i = 0; i < 4; i++) adler = adler << 8 | in.take(8);
    if (adler != adler32(out)) in.fail("the check sum is wrong");
    if (in.position() != stream.size()) in.fail("bytes after the compressed data");
    return out;
}
