// Reads a scene's shapes: plain ones as shapes.c has them, and groups: trees of operations over shapes, with the
// modifiers of each node.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "scene/internal.h"
#include "scene/words.h"

static const double MAX_SLOPE = 1000, FARTHEST = 1e12;
static const char *const MODIFIERS[] = {"shell", "mirror", "displace", "twist", "offset"};

// Enters shapes[index] of the current object, whose `shapes` are given. Returns it, or NULL after an error. `back`
// is for reader_leave.
static json_t *enter_shape(struct reader *r, json_t *shapes, size_t index, size_t *back) {
    char place[24];
    snprintf(place, sizeof place, "[%zu]", index);
    json_t *object = json_array_get(shapes, index);
    *back = reader_enter(r, "shapes");
    if (!json_is_object(object)) {
        reader_fail(r, place, "%s where an object is required", reader_kind(object));
        return NULL;
    }
    reader_enter(r, place);
    return object;
}

// Whether the object, read into `shape`, needs a tree: a group, a modifier, a shape without plain code.
static bool needs_tree(json_t *object, const struct shape *shape) {
    bool modified = false;
    for (int i = 0; i < (shape->type == SHAPE_PLANE ? 4 : 5); i++)
        modified = modified || json_object_get(object, MODIFIERS[i]);
    return modified || shape->type >= SHAPE_GROUP;
}

static void read_mirror(struct reader *r, json_t *object, struct node *node) {
    json_t *axes = reader_member(r, object, "mirror", JSON_STRING, "axes, as in \"xz\",");
    for (const char *c = axes ? json_string_value(axes) : ""; *c && !r->failed; c++) {
        const char *axis = strchr("xyz", *c);
        if (!axis || node->mirror[axis - "xyz"])
            reader_fail(r, "mirror", "\"%.80s\" is not of x, y and z, each once at most",
                        json_string_value(axes));
        else
            node->mirror[axis - "xyz"] = true;
    }
}

static void read_displacement(struct reader *r, json_t *object, struct node *node) {
    json_t *displace = reader_member(r, object, "displace", JSON_OBJECT, "an object");
    if (!displace)
        return;
    static const char *const keys[] = {"amplitude", "frequency", NULL};
    size_t back = reader_enter(r, "displace");
    reader_only_keys(r, displace, keys);
    node->amplitude = reader_number(r, displace, "amplitude", POSITIVE);
    reader_vector(r, displace, "frequency", POSITIVE, node->frequency);
    reader_leave(r, back);
}

static void read_modifiers(struct reader *r, json_t *object, struct node *node) {
    if (json_object_get(object, "shell"))
        node->shell = reader_number(r, object, "shell", POSITIVE);
    if (json_object_get(object, "mirror"))
        read_mirror(r, object, node);
    if (json_object_get(object, "displace"))
        read_displacement(r, object, node);
    if (json_object_get(object, "twist"))
        node->twist = reader_number(r, object, "twist", ANY);
    if (json_object_get(object, "offset") && node->shape.type != SHAPE_PLANE)
        node->offset = reader_number(r, object, "offset", ANY);
}

static void read_operation(struct reader *r, json_t *object, struct node *node) {
    static const char *const names[] = {"union", "intersection", "difference"};
    json_t *name = reader_member(r, object, "operation", JSON_STRING,
                                 "\"union\", \"intersection\" or \"difference\"");
    if (!name)
        return;
    int found;
    if (word_among(json_string_value(name), names, 3, &found))
        node->operation = (enum operation)(NODE_UNION + found);
    else
        reader_fail(r, "operation",
                    "\"%.80s\" is not one of \"union\", \"intersection\", \"difference\"",
                    json_string_value(name));
    if (json_object_get(object, "blend"))
        node->blend = reader_number(r, object, "blend", ROUNDING);
}

// Refuses a node whose bounds, just computed, no phase could work with.
static void check_bounds(struct reader *r, const struct node *node) {
    if (node->twist != 0 && !isfinite(node->twist_radius))
        reader_fail(r, "twist", "what it turns has no end; intersect it with a bounded shape");
    else if (!(node->lipschitz <= MAX_SLOPE))
        reader_fail(r,
                    node->twist != 0      ? "twist"
                    : node->amplitude > 0 ? "displace"
                                          : NULL,
                    "the field's slope reaches %g; %g is the largest there is", node->lipschitz,
                    MAX_SLOPE);
    else if (isfinite(node->radius) && !(node->radius <= FARTHEST))
        reader_fail(r, NULL, "its solid reaches %g, beyond %g, the largest radius there is",
                    node->radius, FARTHEST);
}

// Whether the field is continuous across the walls of cells, across which the node is repeated.
static bool is_continuous(const struct node *node, const double repeat[3]) {
    enum shape_type type = node->operation == NODE_SHAPE ? node->shape.type : SHAPE_GROUP;
    bool bent = node->twist != 0 || node->amplitude > 0;
    bool solid = !bent && type != SHAPE_PLANE && type != SHAPE_GYROID && type != SHAPE_GROUP;
    for (int k = 0; k < 3; k++)
        if (repeat[k] > 0 && !node->mirror[k] && !(solid && !(type == SHAPE_CONE && k == 1)))
            return false;
    return true;
}

// Reads the tree of `object`, which is read into `shape`, to the next node of the model.
static void read_tree(struct reader *r, json_t *object, json_t *materials,
                      const struct shape *shape, int depth, struct model *model) {
    if (is_fractal(shape->type))
        reader_fail(r, "type", "%s: only solids and planes can be in a group",
                    shape_type_name(shape->type));
    else if (model->node_count == SCENE_MAX_NODES)
        reader_fail(r, NULL, "one too many: a scene has %d shapes in groups, and groups, at most",
                    SCENE_MAX_NODES);
    else if (shape->type == SHAPE_GROUP && depth > SCENE_MAX_DEPTH)
        reader_fail(r, NULL, "groups are nested more than %d deep", SCENE_MAX_DEPTH);
    if (r->failed)
        return;
    int index = model->node_count++;
    struct node *node = &model->nodes[index];
    node->shape = *shape;
    read_modifiers(r, object, node);
    if (shape->type == SHAPE_GROUP) {
        read_operation(r, object, node);
        json_t *shapes = reader_member(r, object, "shapes", JSON_ARRAY, "an array of shapes");
        node->children = (int)json_array_size(shapes);
        if (shapes && node->children == 0)
            reader_fail(r, "shapes", "is empty; a group needs a shape");
        for (size_t i = 0; i < json_array_size(shapes) && !r->failed; i++) {
            size_t back;
            struct shape member = {0};
            json_t *child = enter_shape(r, shapes, i, &back);
            if (child)
                scene_read_shape(r, child, materials, &member);
            int first = model->node_count;
            if (!r->failed)
                read_tree(r, child, materials, &member, depth + 1, model);
            node->jumps = node->jumps || model->nodes[first].jumps;
            reader_leave(r, back);
        }
        node->shape.material = node[1].shape.material; // its first shape's
    }
    node->end = model->node_count;
    if (r->failed)
        return;
    node->jumps = node->jumps || !is_continuous(node, shape->repeat);
    node_bound(model->nodes, index);
    check_bounds(r, node);
}

// Reads the tree of such a shape into model->nodes and makes the shape, of $.shapes, a SHAPE_GROUP.
static void read_group(struct reader *r, json_t *object, json_t *materials, struct shape *shape,
                       struct model *model) {
    int root = model->node_count;
    if (!model->nodes)
        model->nodes = reader_allocate(r, SCENE_MAX_NODES + 1, sizeof *model->nodes);
    struct shape inside = *shape;
    inside.path = (struct path){0};
    memset(inside.position, 0, sizeof inside.position);
    memset(inside.rotation_degrees, 0, sizeof inside.rotation_degrees);
    memset(inside.repeat, 0, sizeof inside.repeat);
    if (!r->failed)
        read_tree(r, object, materials, &inside, 1, model);
    if (r->failed)
        return;
    shape->type = SHAPE_GROUP;
    shape->material = model->nodes[root].shape.material;
    shape->group.root = root;
    shape->group.nodes = model->nodes;
    struct node *tree = &model->nodes[root];
    tree->jumps = tree->jumps || !is_continuous(tree, shape->repeat);
    for (int i = root; i < model->node_count; i++)
        if (model->nodes[i].shape.type == SHAPE_GYROID && !isfinite(tree->radius))
            reader_fail(r, NULL,
                        "a gyroid has no end; it should be in an intersection with a "
                        "bounded shape");
}

void scene_read_shapes(struct reader *r, json_t *root, struct model *model) {
    json_t *shapes = reader_member(r, root, "shapes", JSON_ARRAY, "an array of shapes");
    if (!shapes)
        return;
    size_t count = json_array_size(shapes);
    if (count < 1 || count > SCENE_MAX_SHAPES) {
        reader_fail(r, "shapes", "%zu shapes; 1 to %d are allowed", count, SCENE_MAX_SHAPES);
        return;
    }
    model->shapes = reader_allocate(r, count, sizeof *model->shapes);
    json_t *materials = json_object_get(root, "materials");
    for (size_t i = 0; i < count && !r->failed; i++) {
        size_t back;
        struct shape *shape = &model->shapes[i];
        json_t *object = enter_shape(r, shapes, i, &back);
        if (object)
            scene_read_shape(r, object, materials, shape);
        if (!r->failed && needs_tree(object, shape))
            read_group(r, object, materials, shape, model);
        reader_leave(r, back);
        model->shape_count++;
    }
}
