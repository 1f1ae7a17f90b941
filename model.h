// model.h: an .obj with its materials and textures, ready to be drawn. It knows nothing of cameras.
//
// Faces are triangles after loading: polygons are cut (concave ones correctly), and faces are sorted, stably, by
// material.
#pragma once
#include "geometry.h"
#include "tgaimage.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

// A picture on a surface, if there is one; several may share it. It is looked up at uv * scale + offset.
struct Map {
    std::shared_ptr<const TGAImage> picture;
    vec2 scale{1, 1}, offset;
    bool is_moved = false;  // whether they are others than these
    explicit operator bool() const { return picture != nullptr; }
    const TGAImage* operator->() const { return picture.get(); }
};

// What a surface is made of. Where a map is there the shader uses it. No normal map is grey.
struct Material {
    std::string name;
    vec3 Kd{1, 1, 1};  // diffuse reflectance, red green blue in [0,1]; it multiplies the diffuse texel
    vec3 Ke;           // glow, red green blue in [0,1], where there is no map of it
    Map diffuse;       // NAME_diffuse.tga or map_Kd
    Map normal;        // NAME_nm.tga: object space, (r,g,b) = (x,y,z) from [0,255] to [-1,1]
    Map tangent;       // NAME_nm_tangent.tga, norm or map_Bump: tangent space
    Map specular;      // NAME_spec.tga or map_Ns: the Phong exponent, first channel
    Map glow;          // NAME_glow.tga or map_Ke: added after shading
};

// Which normal map is wanted where a model has one in object space and one in tangent space: only that one is decoded.
// Where it has only the other kind, that is taken.
enum class NormalMap { object, tangent };

class Model {
public:
    struct Corner {  // indices from 0 into the model's arrays; uv is -1 where the file gives none
        int vert, uv, normal;
    };
    struct Group {  // the faces [begin,end) share a material
        int begin, end, material;
    };
    struct Note {  // of one kind of thing: the first one, and how many there are
        std::string first;
        int count = 0;
    };
    using Notes = std::map<std::string, Note>;
    // By path, and of each of the materials that use it: its index, and which map the picture is.
    using Textures = std::map<std::string, std::vector<std::pair<int, Map Material::*>>>;

    Model() = default;

    // Reads an .obj with its .mtl, and looks for its textures. Throws std::runtime_error "FILE:LINE: what" (LINE counts
    // from 1), or "FILE: what" for a file that cannot be read or has no face.
    // Takes at most 256 times the size of the files and 160 KiB. A file must not get shorter while it is read, because
    // it may be mapped. Concave polygons with more than 1000 corners stay fans, with a note.
    explicit Model(const std::filesystem::path& obj, NormalMap wanted = NormalMap::object);

    // Decodes the textures that are not LOADED yet, each once: for models that are seen. Throws what
    // TGAImage::read_tga_file throws.
    using Pictures = std::map<std::string, std::shared_ptr<const TGAImage>>;  // by path
    void load_textures(Pictures& loaded);
    void load_textures() {
        Pictures none;
        load_textures(none);
    }

    // Made in memory: three corners a face. It has one material, without maps.
    Model(std::vector<vec3> verts, std::vector<vec2> uvs, std::vector<vec3> normals, std::vector<Corner> corners)
        : verts_(std::move(verts)), normals_(std::move(normals)), uvs_(std::move(uvs)), corners_(std::move(corners)),
          materials_(1), groups_{{0, nfaces(), 0}} {
        find_box();
    }

    // What the user may want to know and is no error: a line for each kind of thing, without the file's name before it.
    std::vector<std::string> notes() const;

    int nverts() const { return static_cast<int>(verts_.size()); }
    int nfaces() const { return static_cast<int>(corners_.size() / 3); }
    const Corner& corner(int face, int c) const { return corners_[std::size_t{3} * face + c]; }
    const std::vector<vec3>& verts() const { return verts_; }
    const vec3& vert(int i) const { return verts_[i]; }
    const vec3& vert(int face, int c) const { return verts_[corner(face, c).vert]; }
    const vec3& normal(int face, int c) const { return normals_[corner(face, c).normal]; }  // unit
    // Whether the file gives none to some corner: then who knows which side of the face is its front?
    bool has_made_normals(int face) const {
        return std::max({corner(face, 0).normal, corner(face, 1).normal, corner(face, 2).normal}) >= given_normals_;
    }
    bool has_colors() const { return !colors_.empty(); }
    const vec3& color(int face, int c) const { return colors_[corner(face, c).vert]; }  // red green blue in [0,1]
    vec2 uv(int face, int c) const {  // (0,0) where the file gives none; v points up
        const int i = corner(face, c).uv;
        return i < 0 ? vec2{} : uvs_[i];
    }

    const std::vector<Material>& materials() const { return materials_; }
    const std::vector<Group>& groups() const { return groups_; }
    const Material& material(int face) const {
        const auto ends_before = [](int f, const Group& g) { return f < g.end; };
        return materials_[std::upper_bound(groups_.begin(), groups_.end(), face, ends_before)->material];
    }

    // The box of all vertices: a vertex that no face uses has been put where another is.
    const vec3& low() const { return low_; }
    const vec3& high() const { return high_; }

    // What has turned the vertices, and turns the normals, too: those above and those of a map are as in the file.
    mat4 turn = mat4::identity();

    // Puts each vertex v where to(v) says.
    template <class F>
    void move(F&& to) {
        for (vec3& v : verts_) v = to(v);
        find_box();
    }

private:
    void find_box() {
        if (!verts_.empty()) low_ = high_ = verts_[0];
        for (const vec3& v : verts_)
            for (int i = 0; i < 3; i++) low_[i] = std::min(low_[i], v[i]), high_[i] = std::max(high_[i], v[i]);
    }

    std::vector<vec3> verts_, normals_, colors_;
    int given_normals_ = INT32_MAX;  // behind these come made ones
    vec3 low_, high_;
    std::vector<vec2> uvs_;
    std::vector<Corner> corners_;  // three a face
    std::vector<Material> materials_;
    std::vector<Group> groups_;
    Textures textures_;
    Notes notes_;
};
