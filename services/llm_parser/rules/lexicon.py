"""The words that the grammar knows. Objects are an open class: no list here decides what an object may be.

The lists hold what closes or colours a phrase: function words, verbs, places, people, times, colours, materials.
"""


def words(text: str) -> frozenset[str]:
    """The words of `text`, as a set."""
    return frozenset(text.split())


FLOOR_NOUNS = words("floor level storey story flr fl lvl lv flor etage floors levels storeys stories flrs lvls")
PLURAL_FLOOR_NOUNS = words("floors levels storeys stories flrs lvls")
ANCHORS = words(
    "window windows windowsill sill ledge balcony balconies terrace glass pane windowpane railing windowbox shutter "
    "shutters veranda loggia"
)
"""Places at which an object marks the customer's window."""

DWELLINGS = words(
    "flat apartment apt apartments place home house unit suite room office studio condo penthouse mine ours one "
    "side location spot address destination bay point kingdom castle door marker mark landmark sign signal beacon"
)
"""What can "have" or be "with" an object, besides windows."""

ARTICLES = words("a an the")
DETERMINERS = ARTICLES | words(
    "this that these those some any each every another no my our your his her its their whose both all half such "
    "which what either neither"
)
MY = words("my our mine ours i we me us myself ourselves")
QUANTIFIERS = words("several many few couple lots lot plenty much more most bit dozen dozens")

PREPOSITIONS = words(
    "of with without within in inside into on onto at by near beside besides behind under underneath below beneath "
    "above over through between among across along around round against from to toward towards for off out outside "
    "up down upon beyond past opposite until till before after since during about as than like via per despite "
    "except unlike next close closest nearest adjacent alongside instead atop amid nearby"
)
PRONOUNS = words(
    "i me we us you he him she they them it mine ours yours hers theirs who whom myself yourself himself herself "
    "itself ourselves themselves someone somebody anyone anybody everyone everybody nobody something anything "
    "everything nothing there here where when while why how whether if because although though unless that which "
    "whose what whatever whoever wherever whenever however"
)
CONJUNCTIONS = words("and or but nor so yet then else plus also too either neither because cause cuz cos coz")
AUXILIARIES = words(
    "is are am was were be been being isn't aren't wasn't weren't do does did don't doesn't didn't done doing have "
    "has had haven't hasn't hadn't having will would shall should can could may might must won't wouldn't can't "
    "cannot couldn't shouldn't ain't mustn't 'll 'd 've 're 'm 's not n't got gotta gonna let let's ought"
)
VERBS = words(
    "displaying displays features featuring featured bearing boasts boasting carrying holding wearing catches "
    "guarding avoid avoids beware ignore ignoring disregard disregarding granted approach arrive arrives arrived "
    "crash crashes notices sees marked accept accepts act add ask asks asked await awaits bark bear bet bless block "
    "boo bother bothers bought break bring brings brought call calls called came cancel cancelled care carry catch "
    "change changed check checked choose chose climb close come comes coming confirm confuse confused consider "
    "continue cost costs count counted covers decided deliver delivers delivered delivering descend die dodge drop "
    "drops dropped dropping eat enjoy ensure enter excuse expect expects expecting explain fall falls feel fell "
    "figure find finds finding fit fits flew float floats flies fly flying follow follows forget forgot found gave "
    "get gets getting give gives go goes going gone guess guessed guard guards guides guide hand handed handing "
    "hang hangs hung happen happens hate hear heard heading help helps hid hide hold holds hope hoping hover hurry "
    "identifies identify indicates insist insists joined keep keeps kept knock know knows known land lands leads "
    "lean leans learn learned leave leaves leaving left lets lie lies lift liked likes listen lived live lives "
    "living look looks looking lose lost love loved loves made make makes making marks mean means meant meet "
    "mention mentioned mind miss missed mistake mix moved move moving must need needs needed notice noticed occupy "
    "offer open opens order ordered owe owns own paid pardon pass pay pick picked placed place places please plant "
    "planted play point points press promise proceed prove put puts putting raise reach reached read realised "
    "realized receive recognise recognize refer relocated remain remains remember remind rent request requested "
    "rescue rest rests return ring ripped route said sat save saw say saying says scare see seem seems seen select "
    "sell send sending sends sent serves serve set sets settle shine shines shout show shows showed shown sit sits "
    "sitting skip sleep sleeping smile smiles speak speed spend spot spots spotted stand stands standing stare stay "
    "stays stick sticks stood stop stops stopped stuck suit suits swear swap take takes taken taking talk tap tell "
    "tells thank thanked think thinks thought throw tied told took touch travel tried trouble trust try trying turn "
    "turned use used using visit wait waiting waits walk want wanted wants warn watch watches wave waves went wish "
    "wonder wondering work works working worry write writing wrote written appreciate belong belongs bothering "
    "distinguishes decorates welcomes greets adorns faces faced hits reads peeking peeks dangles dangling flutters "
    "swings sways lights glows appears sings met ran ate drank drove rode sang swam threw wore woke grew drew fed "
    "fought "
    "froze hid laid lent rang shut slept slid spent spoke stole struck swept swore taught tore understood became "
    "began barks sold shook sought sent spread "
    "blew broke bump bumped carried fastened won owns adorned attached rely depends depend shall suppose supposed "
    "wanting swallow replied reply rate rates judge regret"
)
NOUN_OR_VERB = words(
    "hard bear plant saw watch stand ring swing float stick drill can light lights wave block guard drop set post "
    "rest match fan play fly bar guide hand hold lock clip sink stamp top well press break catch skip pass stock "
    "like past bit lead wreck fall hook bell nest trap pump mine square round still stool glow scale scales stop "
    "lift love second speed figure tap suit throw cover display travel climb"
)
"""Inside a noun phrase these are nouns ("teddy bear", "hand saw"), elsewhere they are not."""

ADJECTIVE_OR_VERB = words(
    "open easy upright lit hung lost outdoor super cool loose cut bent wound set true fine fast lone"
)
"""Right in front of a thing these describe it ("an open umbrella"), elsewhere they are verbs or adverbs."""

DEPICTIONS = words(
    "poster picture painting photo photograph drawing portrait print statue statuette figure figurine model sculpture "
    "sketch cutout silhouette image carving bust tapestry mosaic replica mural"
)
"""What these are "of" may be anything, a lady or a house too."""
FIGURE_STUFF = words("snow gingerbread tin straw lego plastic wooden clay stone paper rubber inflatable cardboard toy")
"""A man of this is a thing."""

BUILDINGS = words("building block tower house street road complex skyscraper shop hotel school office estate")

GENERIC_OWNERS = words(
    "witch knight child kid pirate baby bird cat dog doll cowboy clown santa king queen wizard fireman firefighter "
    "sailor chef workman ship captain butcher baker barber farmer gardener magician shepherd postman policeman men "
    "women children ladies artist painter soldier viking builder miner fisherman valentine st"
)
"""In front of "'s" these say what kind of thing it is ("a witch's broom"), not whose it is."""

EVALUATIVE = words(
    "lovely ugly silly ridiculous beautiful precious famous nice pretty trusty beloved faithful favourite favorite "
    "cute awful horrible hideous gorgeous stupid wonderful magnificent glorious splendid charming dear good great "
    "fine infamous legendary darn bloody damn blasted so-called aforementioned same very actual proud humble "
    "unmistakable obvious usual only said special own other second first right correct real little-known "
    "conspicuous distinctive noticeable eye-catching handsome delightful perfect wretched cursed majestic mighty "
    "iconic "
    "adorable"
)
"""Opinions in front of an object; they are no part of what a camera can see."""

ADVERBS = words(
    "far nervous tasteful higher lower further farther closer bigger sooner very really quite just only still "
    "already again always never ever often sometimes soon now today tomorrow tonight yesterday later early earlier "
    "late ago once twice perhaps maybe please pls plz kindly exactly right straight away back ahead along apart "
    "together well even almost nearly though anyway anyways btw lol haha hihi hehe ok okay kay alright yeah yes yep "
    "yup yay no nope nah thanks thank thx ty cheers ta bye hello hi hey hiya hiii hii yo hullo dear oh ah um uh er "
    "erm hmm mm eh sorry wow omg asap rn tho pretty rather enough too hence thus therefore otherwise clearly "
    "visible obvious facing upstairs downstairs indoors outdoors there here everywhere somewhere anywhere nowhere "
    "else first second third lastly finally firstly secondly overhead sideways upright alone correct wrong sure "
    "true false fine easy careful carefully quick fast slow slowly quickly nice good great bad happy glad able "
    "ready available vacant due outstanding impossible unmissable unmistakable nowadays anymore likewise same "
    "different actually basically literally honestly obviously seriously currently previously formerly originally "
    "recently permanently temporarily definitely certainly probably possibly simply directly immediately gently "
    "safely mainly particularly especially roughly approximately partly mostly i.e e.g etc vs lest mate darling "
    "love buddy pal friend sir madam dude bro captain sweetheart honey hun kiddo hurrah hooray cool awesome super "
    "woohoo prior yippee anyhow hereby herewith dest soo ha aha ooh phew whoops oops oopsie ugh yikes hm welp innit k "
    "u ur r ya yea yeh "
    "ye thru"
)
NUMBERISH = words("number numbers no. nr num #")
TIMES = words(
    "day days week weeks month months year years hour hours minute minutes second seconds morning evening afternoon "
    "night noon midnight lunch dinner breakfast christmas birthday weekend monday tuesday wednesday thursday friday "
    "saturday sunday january february march april june july august september october november december time times "
    "today's moment while summer winter spring autumn o'clock pm am a.m p.m century anniversary grade try attempt "
    "chance"
)
PEOPLE = words(
    "neighbour neighbours neighbor neighbors neighbouring neighboring tenant tenants "
    "lady ladies guy guys man men woman women people person persons folk folks couple family families "
    "audience crowd gentleman gentlemen chap chaps pensioner professor rivals rival grump landlord landlady mr mrs "
    "ms dr owner owners resident residents occupant occupants lad lads bloke student students stranger strangers "
    "colleague colleagues competitor competitors"
)
KIN = words(
    "mum mom mummy mommy mam ma dad daddy papa mama father mother brother sister son daughter wife husband grandma "
    "grandpa granny gran nan nana grandfather grandmother grandson granddaughter aunt auntie uncle cousin boyfriend "
    "girlfriend partner kid kids child children baby boy girl friend friends nurse doctor carer teacher boss widow "
    "warden "
    "caretaker janitor roommate flatmate roommates flatmates widower twin nephew niece"
)
PARCEL_NOUNS = words(
    "parcel parcels package packages delivery deliveries order orders shipment shipments item items goods stuff box "
    "thing things groceries medicine medication medicines prescription pizza pizzas food snacks mail post letter "
    "present gift shopping dinner lunch takeaway meal sushi coffee tea sandwich sandwiches juice cola burger "
    "burgers curry noodles headphones laptop charger "
    "phone documents paperwork contract contracts toner cartridge cartridges nappies diapers formula contents"
)
"""What requests usually order; only lowers a phrase's standing, since a box or a gift may mark a window too."""

SOFT_NOUNS = words(
    "bell machine head train bus plane ring robot wall sign signal beacon mark marker phone telephone "
    "battery button heart hand hands face nose eye case screen board panel clue box item items present gift letter "
    "book laptop thing note lights meter number corner tip kit record drone roof desk keyboard code house castle "
    "tower elephant lot pair stall ticket mail post cartridge food cake doorbell intercom top reference kingdom "
    "wheel form forms picture point drones robots wheelchair map bay office message storm sun wind world air "
    "sky total tool city town village taxi"
)
"""Nouns that name a mark only together with another word: "brass bell", "sewing machine"."""

NON_OBJECTS = (
    TIMES
    | PEOPLE
    | ANCHORS
    | DWELLINGS
    | FLOOR_NOUNS
    | PARCEL_NOUNS
    | words(
        "congratulations english details noise lair twins visual identifier indicator crisis civilization card "
        "façade facade lesson record criminal kingdom train bus flight plane taxi ride client hamster pigeon "
        "building buildings block blocks tower towers street road lane avenue lift lifts elevator elevators stairs "
        "staircase stairwell entrance lobby corridor hallway desk reception buzzer doorbell intercom code gate "
        "gates parking city town country village world weather rain snow sun wind storm drone drones machine "
        "machines operator pilot courier driver customer customers service app message text call email phone "
        "telephone number numbers name names address rent price money pounds dollars bucks euros invoice reference "
        "contact instructions instruction directions direction note notes favour favor problem trouble matter "
        "nuisance mistake confusion question answer idea fact reason reasons way ways part lot bit kind sort type "
        "colour color colours size case word words story version habit luck view views side sides left right top "
        "bottom middle centre center front rear end corner corners edge height eye eyes hand hands head face heart "
        "hurry rush emergency fun joke life death love thanks regards patience care help delay work job meeting "
        "school university college hospital kitchen bedroom bathroom living-room wall walls roof air sky ground "
        "basement penthouse total maximum minimum maintenance attention attn recipient sender subject department "
        "party eyesore nose spectacle disgrace tragedy masterpiece thank bless anyone knocking ring ringing "
        "wheelchair knee ankle leg back typos typo screen scren keyboard form forms button buttons panel look truth "
        "headache cold fever flu emergency lifesaver surprise baby-sitter hunger thirst deadline doubt luck apology "
        "apologies talent talents destiny wishes compliments greetings decor fellow fellows appointment chat job "
        "hurry revenge reward course guests streets mortal coordinates excuse pleasure wish "
        "one ones other others latter former rest none lots plenty dozen pair tops news earth god goodness heaven "
        "sake mission applause hello goodbye cheers noon meter battery signal yes mom's bell hint clue tip"
    )
)
"""Nouns (and what is left of greetings) that name no mark at a window."""

COLOURS = words(
    "red green blue yellow orange purple violet pink brown black white grey gray beige cream crimson scarlet "
    "turquoise teal cyan magenta gold golden silver bronze copper maroon navy lime olive coral ivory lilac lavender "
    "mint tan khaki indigo burgundy rainbow multicoloured multicolored colourful colorful reddish greenish bluish "
    "dark light bright pale neon amber peach salmon mustard"
)
ATTRIBUTES = COLOURS | words(
    "big small large little tiny huge giant tall short long round square old new antique vintage wooden metal "
    "metallic plastic ceramic porcelain clay terracotta stone marble brass iron steel tin wicker leather paper "
    "cardboard cotton woollen wool velvet silk knitted crocheted rubber inflatable stuffed plush painted hand- "
    "striped spotted dotted checked checkered chequered tartan floral flowery patterned polka-dot shiny sparkly "
    "glittery fluffy furry fuzzy cracked broken rusty rusted faded framed hanging potted folding folded wrapped "
    "life-size life-sized oversized miniature mini funny silly ugly cute lovely beautiful pretty strange odd weird "
    "fancy ornate decorative oval heart-shaped star-shaped glass straw bamboo transparent translucent carved empty "
    "full half-empty fresh plain two-tone single double glowing illuminated electric toy garden"
)
OBJECT_NOUNS = words(
    "pot plant plants flower flowers flowerpot vase umbrella parasol lamp lantern candle chair stool table bench "
    "basket bucket can poster painting picture flag banner balloon balloons teddy bear duck doll kite ball bike "
    "bicycle scooter skateboard guitar drum clock mirror bottle jar bowl mug teapot kettle pan broom mop ladder "
    "hammer saw wrench spade shovel rake toolbox drill wreath garland gnome statue figurine buddha chime chimes "
    "windmill pinwheel birdhouse birdcage feeder cage cushion pillow rug towel blanket curtain scarf hat boots "
    "shoes sock socks pumpkin watermelon melon pineapple bananas apple apples bread baguette cake fern cactus "
    "orchid tulips roses sunflower sunflowers bonsai tree dinosaur robot rocket train truck car boat ship globe "
    "telescope trophy shell stocking snowman star moon fish owl penguin unicorn giraffe elephant crate barrel "
    "suitcase backpack bag tin hose sculpture mask dreamcatcher sofa armchair rocking-chair shelf bookshelf easel "
    "fan radio bell surfboard books cat heart pennant tapestry calendar rack bust sign wheel tricycle planter tub "
    "box hamper cooler anchor fountain flamingo rooster lighthouse snake"
)
"""Some things that do stand at windows: a small bonus where two phrases are otherwise alike."""

CONTAINERS = words(
    "pot pots bottle vase bowl cage basket frame jar bucket tank planter hat tub box case mug cup crate tin bag "
    "glass can"
)
MEASURE_NOUNS = words(
    "bunch stack pile pair set string row bag box basket bowl jar bottle pot vase bouquet pack tray crate bucket "
    "collection bundle piece picture poster painting photo photograph drawing statue statuette figure figurine "
    "model portrait print map bust sack roll coil wreath cluster crown plate loaf can tin glass cup bar block slice "
    "trio duo garland sculpture image flag carton barrel tub sheaf spray head sprig mobile cutout silhouette "
    "replica heap jug mosaic bunches pots cage rack strand chain carving tapestry tower cone ball assortment"
)
"""Nouns that take "of": the phrase goes on behind it."""

ING_NOUNS = words(
    "painting awning bunting railing drawing string ring building ceiling clothing king wing swing earring carving "
    "sling spring wedding offering bedding covering etching engraving stocking lightning thing pudding dumpling "
    "duckling figurine bling"
)
ED_WORDS = words("red bed shed sled seed weed reed feed bird-feed ed ted")
LY_WORDS = words(
    "lily jelly holly butterfly dolly curly silly ugly woolly wooly lovely family early only fly trolley teddy "
    "jolly prickly bubbly sparkly frilly wobbly smelly belly elderly lonely friendly gangly supply firefly "
    "dragonfly potbelly"
)

FILLERS = words("um uh er erm uhm umm uhh hmm mm ah eh y'know")

CORRECTIONS = (
    "no sorry",
    "sorry no",
    "no wait",
    "wait no",
    "no what am i saying",
    "what am i saying",
    "scratch that",
    "i mean",
    "make that",
    "correction",
    "or rather",
    "no no",
    "my mistake",
    "i meant",
    "strike that",
    "let me start again",
    "let me correct",
    "hang on",
    "hold on",
    "no hang on",
    "my bad",
    "oops",
    "whoops",
    "in fact",
    "actually",
    "not anymore",
    "forget that",
    "nope",
)
"""What people say between the wrong value and the right one."""

CLOSED = NUMBERISH | PREPOSITIONS | PRONOUNS | CONJUNCTIONS | AUXILIARIES | VERBS | ADVERBS | DETERMINERS | QUANTIFIERS
"""Words that never belong to an object's name, except as the grammar of phrases allows."""
